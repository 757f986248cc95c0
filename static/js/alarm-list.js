// The page of alarms: its list, with the rows that it asks the server for, and the details of an alarm.
import { followLock, isLocked } from "./alarm-line.js";
import { showList } from "./alarm-rows.js";
import { closest, find, setText } from "./show.js";

// The rows that a page chooses of more alarms than the stream brings: asked for when the stream says that something has
// changed, one request at a time and at most one a second.

const PAUSE_MS = 1000; // between two requests
const LONGEST_MS = 10_000; // for an answer

const { rows: address = "" } = find(document, ".alarm-list").dataset;
/** @type {(answer: Data) => void} */
let showAnswer = () => {};
let isWanted = false;
let isStale = false;
let timer = 0;
let askedAt = -PAUSE_MS;

// `wanted` false: the stream has all rows again.
/** @param {boolean} wanted @param {(answer: Data) => void} shown */
function fetchRows(wanted, shown) {
  [isWanted, isStale, showAnswer] = [wanted, wanted, shown];
  if (wanted) plan();
}

function plan() {
  if (timer) return;
  timer = setTimeout(ask, Math.max(0, askedAt + PAUSE_MS - performance.now()));
}

async function ask() {
  isStale = false;
  askedAt = performance.now();
  try {
    const answer = await fetch(address, {
      headers: { accept: "application/json" },
      signal: AbortSignal.timeout(LONGEST_MS),
    });
    if (answer.ok && isWanted) showAnswer(await answer.json());
  } catch {
    isStale = true; // the page itself shows that the server is lost
  }
  timer = 0;
  if (isStale && isWanted) plan();
}

// The details of an alarm with their buttons, and Acknowledge all shown: they follow the events.

const TEXTS = ["text", "state_text", "since_text", "value_text", "limit_text", "details"];

/** @type {{ rows: Map<string, Data>, listed: Data[] }} */
let shown = { rows: new Map(), listed: [] };
/** @type {typeof shown | null} */
let touched = null; // what the screen showed when the finger went down on a button
const section = document.querySelector("section.details");
const chosen = document.querySelector("[data-alarm-details]")?.dataset.alarmDetails ?? "";

addEventListener(
  "pointerdown",
  ({ target }) => {
    touched = closest(target, "main button") ? shown : null;
  },
  true,
);
addEventListener("submit", ({ target }) => fill(closest(target, "form")), true);

followLock(lockActs);

// `listed` are the rows that the list shows.
/** @param {Map<string, Data>} rows @param {Data[]} listed */
function showDetails(rows, listed) {
  shown = { rows: new Map(rows), listed };
  const row = rows.get(chosen);
  if (section && row) for (const name of TEXTS) setText(section.querySelector(`[data-text="${name}"]`), row[name]);
  const over = section?.querySelector(".over");
  if (over) over.hidden = row !== undefined;
  lockActs();
}

// An act that is no longer possible is locked in its place; one that has become possible appears.
function lockActs() {
  const { lock } = find(document, "form.alarm-line").dataset;
  const all = find(document, ".all-shown button");
  all.disabled = isLocked() || !shown.listed.some(mayAcknowledge);
  const acts = shown.rows.get(chosen)?.acts ?? [];
  for (const part of document.querySelectorAll("[data-act]:not([data-fixed])")) {
    const isPossible = acts.includes(part.dataset.act);
    const isMine = part.dataset.roleLock === undefined;
    if (isPossible) part.hidden = false;
    for (const button of part.querySelectorAll("button:not([popovertargetaction])"))
      button.disabled = isLocked() || !isPossible || !isMine;
    for (const needed of part.querySelectorAll("[data-needs-control]")) needed.hidden = lock === "";
  }
}

/** @param {Data} row */
function mayAcknowledge({ acts }) {
  return acts.includes("acknowledge");
}

// A form names the occurrences that the screen showed at the touch, not those of the page's loading or of now.
/** @param {HTMLElement | null} form */
function fill(form) {
  const seen = touched ?? shown;
  if (form?.matches(".all-shown")) {
    for (const input of form.querySelectorAll('[name^="occurrence."]')) input.remove();
    for (const row of seen.listed.filter(mayAcknowledge)) {
      const input = document.createElement("input");
      Object.assign(input, { type: "hidden", name: `occurrence.${row.id}`, value: row.occurrence });
      form.append(input);
    }
  }
  const occurrence = form?.closest("[data-act]") && form.querySelector("input[name=occurrence]");
  const row = seen.rows.get(chosen);
  if (occurrence && row) occurrence.value = row.occurrence;
}

// The list on the page of alarms: a row for each alarm that the page's filter takes, in its order.

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
