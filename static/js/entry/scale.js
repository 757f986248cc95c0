// The bar of the keypad: where a number is between its limits, which are at 12.5 and 87.5 %.
import { numberText } from "../number-text.js";
import { find, setText } from "../show.js";

/** @param {HTMLElement} scale @param {string | null} plain @param {Limits} limits */
export function markScale(scale, plain, { min, max }) {
  const at = 12.5 + (75 * (Number(plain) - Number(min))) / (Number(max) - Number(min));
  scale.style.setProperty("--at", `${Math.min(Math.max(at, 0), 100)}%`);
  scale.classList.toggle("none", plain === null);
  setText(find(scale, "b"), plain !== null && at > 26 && at < 74 ? numberText(plain) : ""); // else it would lie on a limit
}
