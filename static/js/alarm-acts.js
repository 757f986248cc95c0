// Acts on alarms: their requests, and why all of them are locked.
import { newId, post, TAP_AGAIN_MS } from "./press.js";
import { find } from "./show.js";

const RESPONSE_TIMEOUT_MS = 5000;
const TO_CONFIRM = ["confirm_needed_pin", "confirm_needed_two"];
const IN_CONTROL = ["", "holding", "asked"];

// What locks every act, as the line of the frame has it.
const frame = find(document, "form.alarm-line").dataset;
const state = { lock: frame.lock ?? "", isCut: frame.cut !== undefined };
/** @type {Set<() => void>} */
const followers = new Set();

// Calls back at once, and when the lock has changed.
/** @param {() => void} show */
export function followLock(show) {
  followers.add(show);
  show();
}

/** @param {string} role */
export function setControl(role) {
  setLock({ lock: IN_CONTROL.includes(role) ? "" : "control" });
}

/** @param {Partial<typeof state>} changed */
export function setLock(changed) {
  Object.assign(state, changed);
  for (const show of followers) show();
}

export function isLocked() {
  return state.lock !== "" || state.isCut;
}

// Marks a part of the page with the reason, which its style sheet shows.
/** @param {HTMLElement} root */
export function markLock(root) {
  root.dataset.lock = state.lock;
  if (state.isCut) root.dataset.cut = "";
  else delete root.dataset.cut;
}

// Sends an act and returns what its receipt says, "" for nothing. A second tap is the same act: it must not meet another
// alarm that comes to the same place.
/** @param {string} root @param {string} path @param {Record<string, Data>} body @returns {Promise<string>} */
export async function sendAct(root, path, body) {
  const pause = new Promise((resolve) => setTimeout(resolve, TAP_AGAIN_MS));
  const address = `${root}/alarms/${path}`;
  const answer = await send(address, { ...body, id: newId() });
  if (TO_CONFIRM.includes(answer.code)) askPerson(`${address}/confirm`, body);
  await pause;
  return answer.error ?? answer.reason ?? "";
}

// To the page on which a person confirms the act.
/** @param {string} address @param {Record<string, Data>} body */
function askPerson(address, body) {
  const carried = ["occurrence", "reason", "for_s"]
    .filter((name) => body[name])
    .map((name) => [name, String(body[name])]);
  const query = new URLSearchParams([...carried, ["id", newId()], ["page", location.pathname + location.search]]);
  location.assign(`${address}?${query}`);
}

/** @param {string} address @param {object} body @returns {Promise<Data>} */
async function send(address, body) {
  try {
    return await (await post(address, body, RESPONSE_TIMEOUT_MS)).json();
  } catch {
    return { reason: pageGuard.page.sentences.unsure };
  }
}
