// The list on the page of alarms: a row for each alarm that the page's filter takes, in its order.
import { showDetails } from "./alarm-details.js";
import { showList } from "./alarm-rows.js";
import { fetchRows } from "./alarm-rows-beyond.js";
import { find, setText } from "./show.js";

/** @type {Map<string, Data>} */
const rows = new Map();
const list = find(document, "ol.alarms");
const rest = find(document, ".alarm-list .rest");
const { show = "", sort = "", onlyPriority, onlyGroup, onlyRobot } = find(document, ".alarm-list").dataset;
const isFiltered = Boolean(onlyPriority || onlyGroup || onlyRobot);
const isChosen = isFiltered || show !== "all" || sort !== "urgent";
const details = document.querySelector("[data-alarm-details]")?.dataset.alarmDetails ?? "";

/** @type {Record<string, (left: Data, right: Data) => number>} */
const SORTS = {
  newest: (left, right) => raisedAt(left) - raisedAt(right),
  priority: (left, right) => left.priority - right.priority || raisedAt(left) - raisedAt(right),
  group: (left, right) => compare([left.group], [right.group]),
};

// A snapshot has all rows, an event those that changed; null is one that is gone. The server sends so many at most: what
// a page chooses of more than these it is asked for.
/** @param {Data} alarms @param {boolean} isSnapshot */
export function showRows(alarms, isSnapshot) {
  if (isSnapshot) rows.clear();
  for (const [id, row] of Object.entries(alarms.rows)) {
    if (row) rows.set(id, row);
    else rows.delete(id);
  }
  const isBeyond = alarms.more > 0 && (isChosen || (details !== "" && !rows.has(details)));
  fetchRows(isBeyond, showFetched);
  if (isBeyond) return;
  const urgent = [...rows.values()].filter(isTaken).sort((left, right) => compare(left.order, right.order));
  showCounts(countsOf(urgent, alarms));
  const listed = urgent.filter((row) => isShown(show, row));
  if (SORTS[sort]) listed.sort(SORTS[sort]);
  showAll(rows, listed, alarms.more_text);
}

// What the server chose of all alarms.
/** @param {Data} answer */
function showFetched({ alarms, alarm, counts, more_text }) {
  showCounts(counts);
  const known = new Map(alarms.map((/** @type {Data} */ row) => [row.id, row]));
  if (alarm) known.set(alarm.id, alarm);
  showAll(known, alarms, more_text);
}

/** @param {Map<string, Data>} known @param {Data[]} listed @param {string} more */
function showAll(known, listed, more) {
  const firsts = new Set([...known.values()].map(({ follows }) => follows));
  showList(list, find(document, "template#alarm-row"), listed, (item, row) => {
    item.dataset.first = String(firsts.has(row.id));
  });
  setText(rest, more);
  showDetails(known, listed);
}

// The server has counted those that it does not send.
/** @param {Data[]} taken @param {Data} alarms @returns {Record<string, number>} */
function countsOf(taken, { standing, unacknowledged, shelved, suppressed, out_of_service, more }) {
  if (more) return { all: standing + shelved + suppressed + out_of_service, unacknowledged, shelved };
  const names = ["all", "unacknowledged", "shelved"];
  return Object.fromEntries(names.map((name) => [name, taken.filter((row) => isShown(name, row)).length]));
}

/** @param {Record<string, number>} counts */
function showCounts(counts) {
  for (const place of document.querySelectorAll("[data-count]"))
    setText(place, String(counts[place.dataset.count ?? ""] ?? ""));
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
