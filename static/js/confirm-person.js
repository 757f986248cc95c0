// A person confirms a press with a PIN, password or badge, in a sheet beside its button. The server checks it and answers
// with the confirmation of this one press; what was entered is kept nowhere.
import { fillValues } from "./ask.js";
import { openAsking } from "./beside.js";
import { typeDigit } from "./pad.js";
import { APART_MS, SHORTEST } from "./touches.js";
import { post } from "./press.js";
import { closest, find, setText } from "./show.js";

const NOT_NOW_MS = 60_000; // without a touch the sheet goes
const TIMEOUT_MS = 10_000;
const CHECK_TIMEOUT_MS = 60_000; // a hash takes its time on a busy machine
const SLOW_MS = 1500; // a check that takes longer says so

/** @typedef {{ confirmation: string, valid_s: number, reason: string }} Proof */

// `onYes` gets the confirmation. `pressed` is the button whose word is on that of the sheet.
/** @param {HTMLElement} root @param {Record<string, Data>} inputs @param {(event: Event, proof: Proof) => void} onYes @param {HTMLElement | null} pressed */
export async function confirmByPerson(root, inputs, onYes, pressed) {
  const dialog = find(document, "dialog#person");
  const { base, embed } = pageGuard.page;
  const address = `${base}/widgets/${root.dataset.widget}/confirm${embed}`;
  const form = find(dialog, "form");
  if (dialog.matches(":popover-open")) return;
  // The sheet of a recipe says what it changes in the robot.
  const value = root.dataset.kind === "recipe" ? String(inputs[root.dataset.widget ?? ""] ?? "") : "";
  const part = await sheetOf(value ? `${address}${embed ? "&" : "?"}value=${encodeURIComponent(value)}` : address);
  if (dialog.matches(":popover-open")) return;
  form.replaceChildren(part);
  fillValues(dialog);
  followTyping(form);
  const yes = form.querySelector("button.yes");
  if (yes && pressed) setText(yes, pressed.querySelector(".name")?.textContent ?? pressed.textContent);
  /** @param {boolean} isBusy */
  const busy = (isBusy) => {
    if (yes) yes.disabled = isBusy;
  };
  busy(true);
  const asking = openAsking(root, dialog, NOT_NOW_MS, () => busy(false));
  for (const name of /** @type {const} */ (["pointerdown", "keydown"])) asking.on(name, asking.stay);
  asking.on("click", ({ target }) => {
    if (closest(target, "button.no")) asking.close();
    else if (typeDigit(target, "input[name=_pin]")) delete form.dataset.scanned;
  });
  dialog.addEventListener("beforetoggle", () => form.replaceChildren(), { once: true });
  asking.on("submit", async (event) => {
    event.preventDefault();
    if (!yes || yes.disabled) return;
    busy(true);
    const said = form.querySelector(".said");
    setText(said, "");
    const slow = setTimeout(() => setText(said, said?.dataset.checking), SLOW_MS);
    const answer = await check(address, { inputs, ...entered(form) });
    clearTimeout(slow);
    busy(false);
    if (!dialog.matches(":popover-open")) return;
    setText(said, answer.error);
    asking.place();
    if (!answer.confirmation) return;
    asking.close();
    onYes(event, answer);
  });
  const fields = ["select", "[name=_user]", "[name=_pin]", "[name=_password]", "input"];
  const first = fields.map((field) => form.querySelector(field)).find(Boolean);
  (first ?? find(dialog, "button.no")).focus();
}

/** @param {string} address @returns {Promise<HTMLElement>} */
async function sheetOf(address) {
  const lost = document.createElement("p");
  lost.textContent = pageGuard.page.sentences.lost;
  try {
    const answer = await fetch(address, { cache: "no-store", signal: AbortSignal.timeout(TIMEOUT_MS) });
    const page = new DOMParser().parseFromString(await answer.text(), "text/html");
    const part = answer.ok && page.querySelector("div.person");
    return part ? document.importNode(part, true) : lost;
  } catch {
    return lost;
  }
}

/** @param {string} address @param {object} body @returns {Promise<Data>} */
async function check(address, body) {
  try {
    return await (await post(address, body, CHECK_TIMEOUT_MS)).json();
  } catch {
    return { error: pageGuard.page.sentences.lost };
  }
}

// What was entered, which the fields lose with it.
/** @param {HTMLFormElement} form @returns {Record<string, string>} */
function entered(form) {
  /** @param {string} name */
  const taken = (name) => {
    const input = form.querySelector(`input[name=${name}]`);
    if (!(input instanceof HTMLInputElement)) return "";
    const { value } = input;
    input.value = "";
    return value;
  };
  const user = form.querySelector("select")?.value ?? form.querySelector("input[name=_user]")?.value ?? "";
  const [badge, password, pin] = [taken("_badge"), taken("_password"), taken("_pin")];
  const isScanned = form.dataset.scanned !== undefined && form.querySelector("input[name=_badge]");
  delete form.dataset.scanned;
  if (badge || (isScanned && pin)) return { badge: badge || pin };
  return password ? { user, password } : { user, pin };
}

// A badge reader types into the field that has the focus. Its keys are those of `touches.js`; here is what comes without
// keys, as from an input method.
/** @param {HTMLFormElement} form */
function followTyping(form) {
  let last = 0;
  let quick = 0;
  form.querySelector("input[name=_pin]")?.addEventListener("input", () => {
    const now = performance.now();
    quick = now - last < APART_MS ? quick + 1 : 0;
    last = now;
    form.toggleAttribute("data-scanned", quick >= SHORTEST);
  });
}
