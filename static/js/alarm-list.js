// The list on the page of alarms: a row for each alarm, the most urgent first.
import { showDetails } from "./alarm-details.js";
import { showList } from "./alarm-rows.js";
import { find } from "./show.js";

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
  const firsts = new Set([...rows.values()].map(({ follows }) => follows));
  const sorted = [...rows.values()].sort(compare);
  showList(list, find(document, "template#alarm-row"), sorted, (item, row) => {
    item.dataset.first = String(firsts.has(row.id));
  });
  showDetails(rows);
}

/** @param {Data} left @param {Data} right */
function compare({ order: left }, { order: right }) {
  const at = left.findIndex((/** @type {number} */ part, /** @type {number} */ i) => part !== right[i]);
  return at < 0 ? 0 : left[at] - right[at];
}
