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

function markCut(key) {
  const cut = [...key.querySelectorAll(".face > p")].some(isCut);
  key.querySelector(".more").hidden = !cut && !key.querySelector('[data-text="more"]')?.textContent;
  if (key === shown && sheet.matches(":popover-open") && !fillSheet()) sheet.hidePopover();
}

function equip(key) {
  const more = document.getElementById("more").content.firstElementChild.cloneNode(true);
  const face = key.querySelector(".face");
  face.append(more);
  const mark = () => requestAnimationFrame(() => markCut(key));
  new MutationObserver(mark).observe(face, { childList: true, characterData: true, subtree: true });
  new MutationObserver(mark).observe(key.querySelector("button"), { attributeFilter: ["disabled"] });
  new ResizeObserver(mark).observe(key);
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
