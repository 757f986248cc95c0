// The list on the page of alarms: a row for each alarm that the page's filter takes, in its order.
import { showDetails } from "./alarm-details.js";
import { showList } from "./alarm-rows.js";
import { find, setText } from "./show.js";

/** @type {Map<string, Data>} */
const rows = new Map();
const list = find(document, "ol.alarms");
const { show = "", sort = "", onlyPriority, onlyGroup, onlyRobot } = find(document, ".alarm-list").dataset;
const isFiltered = Boolean(onlyPriority || onlyGroup || onlyRobot);

/** @type {Record<string, (left: Data, right: Data) => number>} */
const SORTS = {
  newest: (left, right) => raisedAt(left) - raisedAt(right),
  priority: (left, right) => left.priority - right.priority || raisedAt(left) - raisedAt(right),
  group: (left, right) => compare([left.group], [right.group]),
};

// A snapshot has all rows, an event those that changed; null is one that is gone.
/** @param {Data} alarms @param {boolean} isSnapshot */
export function showRows(alarms, isSnapshot) {
  if (isSnapshot) rows.clear();
  for (const [id, row] of Object.entries(alarms.rows)) {
    if (row) rows.set(id, row);
    else rows.delete(id);
  }
  const firsts = new Set([...rows.values()].map(({ follows }) => follows));
  const urgent = [...rows.values()].filter(isTaken).sort((left, right) => compare(left.order, right.order));
  showCounts(urgent, alarms);
  const listed = urgent.filter((row) => isShown(show, row));
  if (SORTS[sort]) listed.sort(SORTS[sort]);
  showList(list, find(document, "template#alarm-row"), listed, (item, row) => {
    item.dataset.first = String(firsts.has(row.id));
  });
  showDetails(rows, listed);
}

// The server sends so many rows at most: it has counted the others.
/** @param {Data[]} taken @param {Data} alarms */
function showCounts(taken, alarms) {
  const { standing, unacknowledged, shelved, suppressed, out_of_service, more } = alarms;
  /** @type {Record<string, number>} */
  const counted = { all: standing + shelved + suppressed + out_of_service, unacknowledged, shelved };
  for (const place of document.querySelectorAll("[data-count]")) {
    const name = place.dataset.count ?? "";
    const count = isFiltered || !more ? taken.filter((row) => isShown(name, row)).length : counted[name];
    setText(place, String(count));
  }
}

/** @param {Data} row */
function isTaken({ priority, group, robot }) {
  return (
    (!onlyPriority || onlyPriority === String(priority)) &&
    (!onlyGroup || onlyGroup === group) &&
    (!onlyRobot || onlyRobot === robot)
  );
}

/** @param {string} wanted @param {Data} row */
function isShown(wanted, { acknowledged, state, order }) {
  if (wanted === "unacknowledged") return !acknowledged && !order[0];
  return wanted === "all" || wanted === state;
}

/** @param {Data} row */
function raisedAt({ order }) {
  return order.at(-1);
}

/** @param {any[]} left @param {any[]} right */
function compare(left, right) {
  const at = left.findIndex((part, i) => part !== right[i]);
  if (at < 0) return 0;
  return left[at] < right[at] ? -1 : 1;
}
