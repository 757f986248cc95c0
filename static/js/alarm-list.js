// The list on the page of alarms: a row for each alarm, kept in the server's order.
import { lockActs, showDetails } from "./alarm-details.js";
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

export { lockActs };

/** @type {Map<string, Data>} */
const rows = new Map();
const list = find(document, "ol.alarms");

// A snapshot has all rows, an event those that changed; null is one that is gone.
/** @param {Data} alarms @param {boolean} isSnapshot */
export function showRows(alarms, isSnapshot) {
  if (isSnapshot) rows.clear();
  for (const [id, row] of Object.entries(alarms.rows)) {
    if (row) rows.set(id, row);
    else rows.delete(id);
  }
  const shown = new Map([...list.querySelectorAll("li")].map((item) => [item.dataset.alarm ?? "", item]));
  for (const [id, item] of shown) if (!rows.has(id)) item.remove();
  const firsts = new Set([...rows.values()].map(({ follows }) => follows));
  let next = list.firstElementChild;
  for (const row of [...rows.values()].sort(compare)) {
    const item = shown.get(row.id) ?? copyOf(find(document, "template#alarm-row"));
    showRow(item, row);
    item.dataset.first = String(firsts.has(row.id));
    if (item === next) next = item.nextElementSibling;
    else list.insertBefore(item, next);
  }
  showDetails(rows);
}

/** @param {Data} left @param {Data} right */
function compare({ order: left }, { order: right }) {
  const at = left.findIndex((/** @type {number} */ part, /** @type {number} */ i) => part !== right[i]);
  return at < 0 ? 0 : left[at] - right[at];
}

/** @param {HTMLElement} item @param {Data} row */
function showRow(item, row) {
  const link = find(item, "a");
  if (item.dataset.alarm !== row.id) link.href += encodeURIComponent(row.id);
  Object.assign(item.dataset, { alarm: row.id, priority: row.priority, state: row.state });
  item.dataset.acknowledged = row.acknowledged;
  find(item, ".of-priority").dataset.priority = row.priority;
  showTexts(item, row);
}

/** @param {HTMLElement} root @param {Data} row */
function showTexts(root, row) {
  for (const name of TEXTS) setText(root.querySelector(`[data-text="${name}"]`), row[name]);
}
