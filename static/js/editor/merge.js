// What others have written into the file too, and work that was not saved: the person who edits chooses.
import { onState, part, postChoice, say, state, step } from "./wire.js";

const merge = /** @type {HTMLDialogElement} */ (document.getElementById("merge"));
const recovered = /** @type {HTMLDialogElement} */ (document.getElementById("recovered"));
const button = /** @type {HTMLElement} */ (document.getElementById("conflict"));
const again = /** @type {HTMLElement} */ (document.getElementById("write-again"));
let isAsked = false; // whether to go on with what was not saved

/** @param {HTMLDialogElement} dialog @param {string} name */
async function show(dialog, name) {
  const html = await part(name, {});
  if (!html?.trim()) {
    dialog.close();
    return;
  }
  dialog.innerHTML = html;
  if (!dialog.open) dialog.showModal();
}

// Shows what both have changed, if there is something.
export function openMerge() {
  if (state.conflicts) show(merge, "merge");
}

/** @param {Record<string, unknown>} choice */
async function resolve(choice) {
  await postChoice("/resolve", choice);
  if (state.conflicts) show(merge, "merge");
  else {
    merge.close();
    await step("save");
    openMerge();
  }
}

/** @param {Event} event */
function onClick(event) {
  const target = event.target instanceof Element ? event.target : null;
  const side = target?.closest("[data-side]");
  if (side) resolve({ name: side.dataset.conflict, side: side.dataset.side });
  if (target?.closest("[data-later]")) merge.close();
}

export function start() {
  button.addEventListener("click", openMerge);
  again.addEventListener("click", () => step("save", { recreate: true }));
  merge.addEventListener("click", onClick);
  merge.addEventListener("submit", (event) => {
    event.preventDefault();
    if (!(event.target instanceof HTMLFormElement)) return;
    resolve({ name: event.target.dataset.conflict, text: String(new FormData(event.target).get("text") ?? "") });
  });
  recovered.addEventListener("click", async (event) => {
    const key = event.target instanceof Element ? event.target.closest("[data-recovered]") : null;
    if (!key) return;
    recovered.close();
    await postChoice("/recovered", { take: key.dataset.recovered === "take" });
  });
  onState((now) => {
    button.hidden = !now.conflicts;
    again.hidden = !now.gone;
    if (now.warning) say(now.warning);
    if (now.recovered && !isAsked) show(recovered, "recovered");
    isAsked = now.recovered;
  });
}
