// The dialog that sends the saved file to a kiosk: compared first, then sent.
import { onState, part, sendTo } from "./wire.js";

const dialog = /** @type {HTMLDialogElement} */ (document.getElementById("send"));
const button = /** @type {HTMLElement} */ (document.getElementById("send-file"));

// What was typed, as the dialog is drawn again while a kiosk answers.
function entries() {
  const form = dialog.querySelector("form");
  return form ? Object.fromEntries(new FormData(form)) : {};
}

async function draw() {
  const html = await part("send", {});
  if (html === null || !dialog.open) return;
  const typed = entries();
  const focused = document.activeElement;
  const name = focused instanceof HTMLInputElement ? focused.name : "";
  const wasInside = dialog.contains(focused);
  dialog.innerHTML = html;
  for (const input of dialog.querySelectorAll("input")) {
    const text = typed[input.name];
    if (typeof text === "string" && text) input.value = text;
  }
  const again =
    name && !dialog.querySelector("[data-send]:not(:disabled)") ? dialog.querySelector(`[name="${name}"]`) : null;
  const next = again ?? dialog.querySelector("[data-send]:not(:disabled)") ?? dialog.querySelector("[data-send-close]");
  if (wasInside && next instanceof HTMLElement) next.focus();
}

async function open() {
  dialog.innerHTML = "";
  dialog.showModal();
  await draw();
  const first = dialog.querySelector("[autofocus]");
  if (first instanceof HTMLElement) first.focus();
}

/** @param {SubmitEvent} event */
function compare(event) {
  event.preventDefault();
  const typed = entries();
  const token = dialog.querySelector('[name="token"]');
  if (token instanceof HTMLInputElement) token.value = ""; // the editor has it now
  sendTo("/send/compare", typed).then(draw);
}

/** @param {Event} event */
function onClick(event) {
  const target = event.target instanceof Element ? event.target : null;
  if (target?.closest("[data-send-close]")) dialog.close();
  const key = target?.closest("[data-send]");
  if (!(key instanceof HTMLButtonElement) || key.disabled) return;
  key.disabled = true;
  sendTo("/send/take", {}).then(draw);
}

export function start() {
  button.addEventListener("click", open);
  dialog.addEventListener("click", onClick);
  dialog.addEventListener("submit", compare);
  dialog.addEventListener("close", () => button.focus());
  onState((now, before) => {
    if (dialog.open && now.sending !== before.sending) draw();
  });
}
