// What a new file, or a further page, is started from: the person who edits chooses.
import { showPage } from "./preview.js";
import { select } from "./selection.js";
import { onState, part, start as post, state } from "./wire.js";

const dialog = /** @type {HTMLDialogElement} */ (document.getElementById("start"));
const offer = /** @type {HTMLElement} */ (document.getElementById("start-from"));

export async function ask() {
  const html = await part("start", {});
  if (html === null) return;
  dialog.innerHTML = html;
  if (!dialog.open) dialog.showModal();
}

/** @param {Event} event */
async function onClick(event) {
  const key = event.target instanceof Element ? event.target.closest("[data-start]") : null;
  if (!key?.dataset.start || dialog.ariaBusy === "true") return;
  const wasNew = state.new;
  dialog.ariaBusy = "true";
  const answer = await post(JSON.parse(key.dataset.start));
  dialog.ariaBusy = null;
  const message = dialog.querySelector(".message");
  if (message instanceof HTMLElement) {
    message.textContent = answer.message ?? "";
    message.hidden = !answer.message;
  }
  if (answer.message) return;
  dialog.close();
  if (wasNew)
    location.reload(); // its languages are other ones
  else if (answer.page) {
    if (answer.select) select(answer.select, "edit");
    showPage(answer.page);
  }
}

export function start() {
  dialog.addEventListener("click", onClick);
  offer.addEventListener("click", ask);
  onState((now) => {
    offer.hidden = !now.new;
  });
}
