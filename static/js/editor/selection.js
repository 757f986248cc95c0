// What is selected: the path of a table, in the document; it is the same in all panes.
import { tellSelection } from "./wire.js";

/** @typedef {import("./wire.js").Path} Path */

/** @type {Path | null} */
let selected = null;
/** @type {((path: Path | null, from: string) => void)[]} */
const listeners = [];

export const selection = () => selected;

/** @param {(path: Path | null, from: string) => void} listener */
export function onSelect(listener) {
  listeners.push(listener);
}

// `from` is the pane where it was selected.
/** @param {Path | null} path @param {string} from */
export function select(path, from) {
  if (isSame(path, selected)) return;
  selected = path;
  tellSelection(path);
  for (const listener of listeners) listener(path, from);
}

/** @param {Path | null} path @param {Path | null} other */
export function isSame(path, other) {
  return JSON.stringify(path) === JSON.stringify(other);
}

// Whether the table `outer` is around the other, or the same.
/** @param {Path} outer @param {Path} inner */
export function isAround(outer, inner) {
  return outer.every((part, number) => inner[number] === part);
}
