// A group whose buttons are all locked for one reason says it once, beside its title, if it has room there.
import { closest, find, setText } from "./show.js";

const LEAST = 2; // buttons

/** @param {HTMLElement} key */
const reasonOf = (key) => [...key.querySelectorAll(".why, .reasons")].map((text) => text.textContent.trim()).join("\n");

// Called after a change of these keys; `isLocked` tells of each.
/** @param {Iterable<HTMLElement>} keys @param {(key: HTMLElement) => boolean} isLocked */
export function sayOnce(keys, isLocked) {
  const groups = new Set([...keys].map((key) => closest(key, ".group:has(> .head > .said)")));
  for (const group of groups) if (group) show(group, isLocked);
}

/** @param {HTMLElement} group @param {(key: HTMLElement) => boolean} isLocked */
function show(group, isLocked) {
  const said = find(group, ".said");
  const keys = [...group.querySelectorAll('.key, [data-kind="step"]')];
  const [reason, ...others] = new Set(keys.map((key) => (isLocked(key) ? reasonOf(key) : "")));
  const isOne = keys.length >= LEAST && reason && !others.length;
  setText(find(said, "span"), isOne ? find(keys[0], '.why [data-text="reason"]').textContent : "");
  group.toggleAttribute("data-said", Boolean(isOne));
  if (isOne && isCut(said)) group.toggleAttribute("data-said", false);
}

// Also where the head is not shown, as where groups take turns.
/** @param {HTMLElement} text */
function isCut(text) {
  const { scrollHeight, clientHeight, scrollWidth, clientWidth } = text;
  return !clientHeight || scrollHeight > clientHeight + 1 || scrollWidth > clientWidth + 1;
}
