// The full text of a key in a sheet beside it: its face shows what there is room for. A touch on a locked key opens it
// with why it is locked and what to do, and so does the "…" of the key, which a keyboard reaches. An open sheet follows
// its key. A touch on the bar of control shows its text in full.
import { placeBeside, uncoverPage } from "./beside.js";
import { sayOnce } from "./group-locks.js";
import { closest, copyOf, find, setText } from "./show.js";

const TEXTS = ".reasons, .why, .goal, .holding, .receipt, .result";
const FIRST_MS = 200; // so long the sheet waits for the server before it opens with the text that the page has
const AGAIN_MS = 1000; // between two looks at the server while it is open
const SOON_MS = 100; // after a change of the lock
const sheet = find(document, "#whole");
const part = find(sheet, ".lock"); // from the server
/** @type {HTMLElement | null} */
let shown = null; // the key, or another element, whose text the sheet shows
let timer = 0;
let looks = 0; // at the server: only the answer to the last one counts

/** @param {HTMLElement} key */
function isLocked(key) {
  return key.dataset.enabled ? key.dataset.enabled === "false" : key.querySelector("button")?.disabled === true;
}

const isOpen = () => sheet.matches(":popover-open");

/** @param {HTMLElement} key */
function visibleTexts(key) {
  const locked = isLocked(key);
  const reasons = key.querySelector(".reasons")?.textContent;
  const shown = [...key.querySelectorAll(TEXTS)].filter((text) => {
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
async function open(key, byKeyboard) {
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
  const { lockHelp } = await import("./lock-help.js");
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
function follow(key) {
  if (key !== shown) return;
  if (key.matches("[data-asked]")) {
    clearTimeout(timer);
    if (isLocked(key)) timer = setTimeout(() => refresh(key), SOON_MS);
    else if (isOpen()) close();
    else release();
  } else if (isOpen() && !showTexts(key)) sheet.hidePopover();
}

/** @param {HTMLElement} text */
function isCut(text) {
  return text.scrollHeight > text.clientHeight + 1 || text.scrollWidth > text.clientWidth + 1;
}

// A locked key has it always: the button itself has no focus.
/** @param {HTMLElement} key @param {boolean} cut */
function showMore(key, cut) {
  const more = find(key, ".more");
  const isComplete = !cut && !isLocked(key) && !key.querySelector('[data-text="more"]')?.textContent;
  more.toggleAttribute("hidden", isComplete && document.activeElement !== more);
  more.toggleAttribute("data-clipped", cut);
  const focused = document.activeElement;
  if (isLocked(key) && focused?.matches("button:disabled") && key.contains(focused)) more.focus();
  follow(key);
}

/** @type {Set<HTMLElement>} */
const changed = new Set(); // keys whose face or size is another since the last frame

/** @param {HTMLElement} key */
function mark(key) {
  if (!changed.size) requestAnimationFrame(markAll);
  changed.add(key);
}

// All are measured before the first is changed: the page is laid out once.
function markAll() {
  const keys = [...changed].map((key) => ({
    key,
    cut: [...key.querySelectorAll(":is(.face, .told) > p")].some(isCut),
  }));
  changed.clear();
  for (const { key, cut } of keys) showMore(key, cut);
  const roots = keys.map(({ key }) => key);
  sayOnce(roots, isLocked);
}

// A key, or a step or a switch, whose two keys have one text.
/** @param {HTMLElement} key */
function equip(key) {
  const face = find(key, ".face, .reported, .told");
  const more = copyOf(find(document, "template#more"));
  more.setAttribute("aria-describedby", find(key, "button").getAttribute("aria-describedby") ?? "");
  more.addEventListener("blur", () => mark(key));
  face.append(more);
  const observer = new MutationObserver(() => mark(key));
  const texts = { childList: true, characterData: true, subtree: true };
  for (const text of face.querySelectorAll(TEXTS)) observer.observe(text, texts);
  for (const button of key.querySelectorAll("button")) observer.observe(button, { attributeFilter: ["disabled"] });
  new ResizeObserver(() => mark(key)).observe(key);
  key.addEventListener("click", (event) => {
    if (closest(event.target, ".more") || (isLocked(key) && !closest(event.target, "button")))
      open(key, event.detail === 0);
  });
}

for (const key of document.querySelectorAll('.key, [data-kind="step"], [data-kind="switch"]')) equip(key);

sheet.addEventListener("beforetoggle", ({ newState }) => newState === "closed" && release());
find(sheet, ".close").addEventListener("click", close);
addEventListener("resize", place);

const control = document.querySelector("#control");
control?.querySelector("div")?.addEventListener("click", () => {
  release();
  shown = control;
  const texts = [...control.querySelectorAll("p")].map((text) => text.textContent).filter(Boolean);
  show(control.getAttribute("aria-label") ?? "", texts, null);
  sheet.showPopover();
  place();
});
