// The details of an alarm with their buttons, and Acknowledge all shown: they follow the events.
import { followLock, isLocked } from "./alarm-acts.js";
import { closest, find, setText } from "./show.js";

const TEXTS = ["text", "state_text", "since_text", "value_text", "limit_text", "details"];

/** @type {{ rows: Map<string, Data>, listed: Data[] }} */
let shown = { rows: new Map(), listed: [] };
/** @type {typeof shown | null} */
let touched = null; // what the screen showed when the finger went down on a button
const details = document.querySelector("section.details");
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
export function showDetails(rows, listed) {
  shown = { rows: new Map(rows), listed };
  const row = rows.get(chosen);
  if (details && row) for (const name of TEXTS) setText(details.querySelector(`[data-text="${name}"]`), row[name]);
  const over = details?.querySelector(".over");
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
