// Shows the joints of a widget, a row each.
import { find, setText } from "../show.js";

/** @template T @param {HTMLElement} root @param {T[]} values @param {(row: HTMLElement, value: T) => void} show */
const eachRow = (root, values, show) => {
  for (const [number, row] of root.querySelectorAll("li").entries()) show(row, values[number]);
};

/** @type {Record<string, Show>} */
export const show = {
  joint_values: (root, texts) => eachRow(root, texts, (row, text) => setText(row.querySelector(".now"), text)),
  joint_levels: (root, levels) => eachRow(root, levels, (row, level) => (row.dataset.level = level)),
  joint_bars: (root, bars) => eachRow(root, bars, place),
};

// `percent` is from the lower end of the range, null where it is unknown.
/** @param {HTMLElement} row @param {number | null} percent */
function place(row, percent) {
  const zero = Number(row.dataset.zero);
  const [amount, pointer] = [".amount", ".pointer"].map((part) => find(row, part));
  for (const part of [amount, pointer]) part.toggleAttribute("hidden", percent === null);
  if (percent === null) return;
  pointer.setAttribute("x", `${percent}%`);
  amount.setAttribute("x", `${Math.min(zero, percent)}%`);
  amount.setAttribute("width", `${Math.abs(percent - zero).toFixed(1)}%`);
}
