// The rows that a page chooses of more alarms than the stream brings: asked for when the stream says that something has
// changed, one request at a time and at most one a second.
import { find } from "./show.js";

const PAUSE_MS = 1000; // between two requests
const LONGEST_MS = 10_000; // for an answer

const { rows: address = "" } = find(document, ".alarm-list").dataset;
/** @type {(answer: Data) => void} */
let show = () => {};
let isWanted = false;
let isStale = false;
let timer = 0;
let askedAt = -PAUSE_MS;

// `wanted` false: the stream has all rows again.
/** @param {boolean} wanted @param {(answer: Data) => void} shown */
export function fetchRows(wanted, shown) {
  [isWanted, isStale, show] = [wanted, wanted, shown];
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
    if (answer.ok && isWanted) show(await answer.json());
  } catch {
    isStale = true; // the page itself shows that the server is lost
  }
  timer = 0;
  if (isStale && isWanted) plan();
}
