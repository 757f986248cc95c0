// The pads of the pages of sign-in and of the confirmation of an act on an alarm: they type into the field of the PIN, and
// the sign-in is sent, without a new page.
import { typeDigit } from "./pad.js";
import { closest, find } from "./show.js";

const SLOW_MS = 1500; // a check that takes longer says so
let checks = false;
const main = document.querySelector("main.sign-in");
const confirmation = document.querySelector("form[data-confirm-act]");

/** @param {SubmitEvent} event */
async function submitted(event) {
  const form = event.target;
  if (!(form instanceof HTMLFormElement) || form.action.endsWith("/end")) return;
  event.preventDefault();
  if (checks) return;
  const inputs = [...form.elements].filter((input) => input instanceof HTMLInputElement);
  const fields = inputs.map((input) => [input.name, input.value]);
  for (const input of form.querySelectorAll("input")) if (input.type === "password") input.value = "";
  const said = find(document, "p.said");
  checks = true;
  said.textContent = "";
  const slow = setTimeout(() => (said.textContent = said.dataset.checking ?? ""), SLOW_MS);
  const error = await signIn(Object.fromEntries(fields));
  clearTimeout(slow);
  checks = false;
  said.textContent = error;
  if (!error) location.assign(`${main?.dataset.next}`);
}

// Signs in, and returns why not.
/** @param {object} body @returns {Promise<string>} */
async function signIn(body) {
  try {
    const answer = await fetch(`${main?.dataset.signin}`, {
      method: "POST",
      headers: { "content-type": "application/json" },
      body: JSON.stringify(body),
    });
    return answer.ok ? "" : String((await answer.json()).error);
  } catch {
    return pageGuard.page.sentences.lost;
  }
}

// The name that is typed goes with its user to the other way to sign in.
main?.addEventListener("click", ({ target }) => {
  const link = closest(target, ".secret > a");
  const name = document.querySelector("input#user");
  if (!(link instanceof HTMLAnchorElement) || !(name instanceof HTMLInputElement)) return;
  const address = new URL(link.href);
  address.searchParams.set("user", name.value);
  link.href = address.href;
});
main?.addEventListener("submit", (event) => void submitted(event));

main?.addEventListener("click", ({ target }) => typeDigit(target, "input[name=pin]"));
confirmation?.addEventListener("click", ({ target }) => typeDigit(target, "input[name=_pin]"));
const yes = confirmation?.querySelector("button.yes");
if (yes) yes.disabled = false;
