// What a key says, whole: its face shows two lines. A touch on a locked key shows it, or one on the sign that
// there is more, which a keyboard reaches too. An open sheet follows its key. A touch on who has control shows
// that whole.
import { setText } from "./show.js";

const TEXTS = ".reasons, .why, .goal, .holding, .receipt, .result";
const sheet = document.getElementById("whole");
let shown = null; // the key of the sheet

function visibleTexts(key) {
  const locked = key.querySelector("button")?.disabled;
  const reasons = key.querySelector(".reasons")?.textContent;
  const shown = [...key.querySelectorAll(TEXTS)].filter((text) => {
    if (text.matches(".why")) return locked && !reasons;
    return !text.matches(".reasons") || locked;
  });
  return shown.map((text) => text.textContent.trim()).filter(Boolean);
}

function fillSheet() {
  const texts = visibleTexts(shown);
  if (texts.length) setText(sheet.querySelector("p"), texts.join("\n"));
  return texts.length > 0;
}

function showWhole(key) {
  shown = key;
  setText(sheet.querySelector("h2"), key.querySelector(".name").textContent);
  if (fillSheet()) sheet.showPopover();
}

function isCut(text) {
  return text.scrollHeight > text.clientHeight + 1;
}

function showCut(key, cut) {
  const isWhole = !cut && !key.querySelector('[data-text="more"]')?.textContent;
  key.querySelector(".more").toggleAttribute("hidden", isWhole);
  if (key === shown && sheet.matches(":popover-open") && !fillSheet()) sheet.hidePopover();
}

const changed = new Set(); // keys whose face or size is another since the last frame

function mark(key) {
  if (!changed.size) requestAnimationFrame(markAll);
  changed.add(key);
}

// All are measured before the first is changed: the page is laid out once.
function markAll() {
  const keys = [...changed].map((key) => [key, [...key.querySelectorAll(".face > p")].some(isCut)]);
  changed.clear();
  for (const [key, cut] of keys) showCut(key, cut);
}

function equip(key) {
  const more = document.getElementById("more").content.firstElementChild.cloneNode(true);
  const face = key.querySelector(".face");
  face.append(more);
  const observer = new MutationObserver(() => mark(key));
  observer.observe(face, { childList: true, characterData: true, subtree: true });
  observer.observe(key.querySelector("button"), { attributeFilter: ["disabled"] });
  new ResizeObserver(() => mark(key)).observe(key);
  key.addEventListener("click", ({ target }) => {
    const locked = key.querySelector("button").disabled && !target.closest("button");
    if (locked || target.closest(".more")) showWhole(key);
  });
}

for (const key of document.querySelectorAll(".key")) equip(key);

const control = document.getElementById("control");
control?.querySelector("div").addEventListener("click", () => {
  shown = null;
  setText(sheet.querySelector("h2"), control.getAttribute("aria-label"));
  const texts = [...control.querySelectorAll("p")].map((text) => text.textContent).filter(Boolean);
  setText(sheet.querySelector("p"), texts.join("\n"));
  sheet.showPopover();
});
