// The sheet that shows the full text of a key beside it: with why it is locked and what to do, from the server.
import { placeBeside, uncoverPage } from "./beside.js";
import { closest, find, isLocked, KEY_TEXTS, setText } from "./show.js";

// Why a button is locked and what to do, as the server has it now: a part of a page.
const TIMEOUT_MS = 1500;

// Null where it can't be got, or where the server does not lock the button.
/** @param {string | undefined} widget @returns {Promise<HTMLElement | null>} */
async function lockHelp(widget) {
  const request = new AbortController();
  const timer = setTimeout(() => request.abort(), TIMEOUT_MS);
  try {
    if (pageGuard.isBroken || "cut" in document.body.dataset) return null;
    const { base, embed } = pageGuard.page;
    const response = await fetch(`${base}/widgets/${widget}/lock${embed}`, {
      cache: "no-store",
      signal: request.signal,
    });
    if (response.status !== 200) return null;
    const part = new DOMParser().parseFromString(await response.text(), "text/html").querySelector("div");
    return part && document.importNode(part, true);
  } catch {
    return null;
  } finally {
    clearTimeout(timer);
  }
}

// The sheet. While it is open it follows its key.

const FIRST_MS = 200; // so long the sheet waits for the server before it opens with the text that the page has
const AGAIN_MS = 1000; // between two looks at the server while it is open
const SOON_MS = 100; // after a change of the lock
const sheet = find(document, "#whole");
const part = find(sheet, ".lock"); // from the server
/** @type {HTMLElement | null} */
let shown = null; // the key, or another element, whose text the sheet shows
let timer = 0;
let looks = 0; // at the server: only the answer to the last one counts

const isOpen = () => sheet.matches(":popover-open");

/** @param {HTMLElement} key */
function visibleTexts(key) {
  const locked = isLocked(key);
  const reasons = key.querySelector(".reasons")?.textContent;
  const shown = [...key.querySelectorAll(KEY_TEXTS)].filter((text) => {
    if (text.matches(".why")) return locked && !reasons;
    return !text.matches(".reasons") || locked;
  });
  return shown.map((text) => text.textContent.trim()).filter(Boolean);
}

// What the page itself knows. Whether there is anything.
/** @param {HTMLElement} key */
function showTexts(key) {
  const texts = visibleTexts(key);
  if (texts.length) show(find(key, ".name, h3").textContent, texts, null);
  return texts.length > 0;
}

/** @param {string | undefined} title @param {string[]} texts @param {HTMLElement | null} help */
function show(title, texts, help) {
  setText(find(sheet, "h2"), title);
  setText(find(sheet, "p"), texts.join("\n"));
  find(sheet, "p").hidden = help !== null;
  if (!help) part.replaceChildren();
  else if (!part.firstElementChild?.isEqualNode(help)) part.replaceChildren(help);
  place();
}

function place() {
  if (shown && isOpen()) placeBeside(sheet, find(shown, "button, p").getBoundingClientRect());
}

/** @param {HTMLElement} key @param {boolean} byKeyboard */
export async function open(key, byKeyboard) {
  if (key === shown && isOpen()) return;
  release();
  shown = key;
  if (isLocked(key)) {
    key.toggleAttribute("data-asked", true);
    await Promise.race([refresh(key), new Promise((resolve) => setTimeout(resolve, FIRST_MS))]);
    if (key !== shown || isOpen()) return;
  }
  if (!part.firstElementChild && !showTexts(key)) return release();
  sheet.showPopover();
  place();
  if (byKeyboard) find(sheet, "button").focus();
}

// As the server has it now, again and again while the sheet is open.
/** @param {HTMLElement} key */
async function refresh(key) {
  clearTimeout(timer);
  const look = ++looks;
  const help = await lockHelp(closest(key, "[data-widget]")?.dataset.widget);
  if (look !== looks || key !== shown || !isLocked(key)) return;
  if (help) show(help.dataset.title, [], help);
  else showTexts(key);
  timer = setTimeout(() => refresh(key), AGAIN_MS);
}

function release() {
  clearTimeout(timer);
  shown?.toggleAttribute("data-asked", false);
  shown = null;
  part.replaceChildren();
}

// What it covers is not pressed by a tap that was meant for it.
function close() {
  uncoverPage();
  if (isOpen()) sheet.hidePopover();
}

// The lock of the key, or its text, is another.
/** @param {HTMLElement} key */
export function follow(key) {
  if (key !== shown) return;
  if (key.matches("[data-asked]")) {
    clearTimeout(timer);
    if (isLocked(key)) timer = setTimeout(() => refresh(key), SOON_MS);
    else if (isOpen()) close();
    else release();
  } else if (isOpen() && !showTexts(key)) sheet.hidePopover();
}

// The bar of control in full.
/** @param {HTMLElement} control */
export function openControl(control) {
  release();
  shown = control;
  const texts = [...control.querySelectorAll("p")].map((text) => text.textContent).filter(Boolean);
  show(control.getAttribute("aria-label") ?? "", texts, null);
  sheet.showPopover();
  place();
}

sheet.addEventListener("beforetoggle", ({ newState }) => newState === "closed" && release());
find(sheet, ".close").addEventListener("click", close);
addEventListener("resize", place);
