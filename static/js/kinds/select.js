// A select whose options the robot has. The choice stays while the robot lists it.

/** @param {HTMLSelectElement} select @param {string[]} texts */
function showOptions(select, texts) {
  const [none] = select.options;
  const chosen = select.value;
  const made = texts.map((text) => new Option(text, text, false, text === chosen));
  select.replaceChildren(none, ...made);
  if (!texts.includes(chosen)) none.selected = true;
}

/** @type {Record<string, Show>} */
export const show = {
  options: (root, texts) => {
    const select = root.querySelector("select[data-robot]");
    if (select instanceof HTMLSelectElement) showOptions(select, texts);
  },
};
