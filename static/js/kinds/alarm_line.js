// A line of alarms on a page.
import { LineView } from "../alarm-line.js";

/** @type {WeakMap<HTMLElement, LineView>} */
const lines = new WeakMap();

// Called for each widget of this kind.
/** @param {HTMLElement} root @param {PageSource} source */
export const equip = (root, source) => lines.set(root, new LineView(root, source));

/** @type {Record<string, Show>} */
export const show = { alarms: (root, alarms) => lines.get(root)?.show(alarms) };
