// The rows of a list of alarms, kept in the server's order.
import { copyOf, find, setText } from "./show.js";

const TEXTS = [
  "priority_text",
  "state_text",
  "since_text",
  "text",
  "group",
  "follows_text",
  "value_text",
  "limit_text",
];

// The row that an item of a list shows.
/** @type {WeakMap<HTMLElement, Data>} */
export const rowOf = new WeakMap();
/** @type {() => void} */
let changed = () => {};

// Calls back when a list has changed.
/** @param {() => void} show */
export function followRows(show) {
  changed = show;
}

// Shows rows in a list, in their order. `more` shows what is special of a list, and may add to a new row.
/**
 * @param {HTMLElement} list
 * @param {HTMLTemplateElement} template
 * @param {Data[]} rows
 * @param {(item: HTMLElement, row: Data) => void} more
 */
export function showList(list, template, rows, more) {
  const shown = new Map([...list.querySelectorAll("li")].map((item) => [item.dataset.alarm ?? "", item]));
  const ids = new Set(rows.map(({ id }) => id));
  for (const [id, item] of shown) if (!ids.has(id)) item.remove();
  let next = list.firstElementChild;
  for (const row of rows) {
    const item = shown.get(row.id) ?? copyOf(template);
    showRow(item, row);
    more(item, row);
    if (item === next) next = item.nextElementSibling;
    else list.insertBefore(item, next);
  }
  changed();
}

/** @param {HTMLElement} item @param {Data} row */
function showRow(item, row) {
  rowOf.set(item, row);
  const link = find(item, "a");
  if (item.dataset.alarm !== row.id) link.href += encodeURIComponent(row.id);
  find(item, "button.more-acts").value = row.id;
  Object.assign(item.dataset, { alarm: row.id, priority: row.priority, state: row.state });
  item.dataset.acknowledged = row.acknowledged;
  find(item, ".of-priority").dataset.priority = row.priority;
  for (const name of TEXTS) setText(item.querySelector(`[data-text="${name}"]`), row[name]);
}
