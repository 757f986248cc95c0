// Inputs of which the robot says more: `select`, `switch` and `parameter`.
import { showBounds, showEntry } from "../entries.js";
import { find } from "../show.js";

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
const showSelect = {
  options: (root, texts) => {
    const select = root.querySelector("select[data-robot]");
    if (select instanceof HTMLSelectElement) showOptions(select, texts);
  },
};

// A switch moves when the robot reports it: the position that it has can't be pressed.
/** @type {Record<string, Show>} */
const showSwitch = {
  at: (root, position) => {
    root.dataset.at = position;
    arrange(root);
  },
};

/** @param {HTMLElement} root @param {boolean} locked */
function lock(root, locked) {
  root.dataset.enabled = String(!locked);
  arrange(root);
}

/** @param {HTMLElement} root */
function arrange(root) {
  for (const key of root.querySelectorAll("button[data-position]")) {
    const isReported = key.dataset.position === root.dataset.at;
    key.disabled = isReported || root.dataset.enabled === "false";
    key.setAttribute("aria-pressed", String(isReported));
  }
}

// What a key sends: its value when the finger went down.
/** @param {HTMLButtonElement} key @param {string} value */
const values = (key, value) => ({ [key.name]: value === "true" });

// A parameter: its input shows the robot's value, with the limits that its node describes.

// The robot's value is read again: the response arrives as an event.
/** @param {HTMLElement} root */
function equipParameter(root) {
  const button = find(root, "button.read");
  button.addEventListener("click", (event) => {
    if (event.defaultPrevented) return;
    event.preventDefault();
    fetch(button.formAction, { method: "POST" }).catch(() => {});
  });
}

/** @type {Record<string, Show>} */
const showParameter = {
  askable: (root, value) => (find(root, "button.read").disabled = !value),
  entry: showEntry,
  bounds: showBounds,
  settable: (root, value) => (find(root, ".setting").inert = !value),
};

/** @type {Hooks} */
export const select = { show: showSelect };
/** @type {Hooks} */
export const parameter = { equip: equipParameter, show: showParameter };
const ofSwitch = { show: showSwitch, lock, values };
export { ofSwitch as switch };
