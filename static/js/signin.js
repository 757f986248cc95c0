// The page of sign-in: the pad types into the field of the PIN, and the sign-in is sent without a new page.
import { closest, find } from "./show.js";

const main = find(document, "main.sign-in");

/** @param {SubmitEvent} event */
async function submitted(event) {
  const form = event.target;
  if (!(form instanceof HTMLFormElement) || form.action.endsWith("/end")) return;
  event.preventDefault();
  const digit = event.submitter instanceof HTMLButtonElement ? event.submitter.value : "";
  if (form.dataset.way === "pin" && digit !== "enter" && digit !== "") return typed(form, digit);
  const inputs = [...form.elements].filter((input) => input instanceof HTMLInputElement);
  const fields = inputs.map((input) => [input.name, input.value]);
  for (const input of form.querySelectorAll("input")) if (input.type === "password") input.value = "";
  const said = find(document, "p.said");
  try {
    const answer = await fetch(`${main.dataset.signin}`, {
      method: "POST",
      headers: { "content-type": "application/json" },
      body: JSON.stringify(Object.fromEntries(fields)),
    });
    if (answer.ok) location.assign(`${main.dataset.next}`);
    else said.textContent = String((await answer.json()).error);
  } catch {
    said.textContent = pageGuard.page.sentences.lost;
  }
}

/** @param {HTMLFormElement} form @param {string} digit */
function typed(form, digit) {
  const input = find(form, "input[name=pin]");
  const edited = { clear: "", delete: input.value.slice(0, -1) };
  input.value = digit === "clear" || digit === "delete" ? edited[digit] : (input.value + digit).slice(0, 12);
}

// The name that is typed goes with its user to the other way to sign in.
main.addEventListener("click", ({ target }) => {
  const link = closest(target, ".secret > a");
  const name = document.querySelector("input#user");
  if (!(link instanceof HTMLAnchorElement) || !(name instanceof HTMLInputElement)) return;
  const address = new URL(link.href);
  address.searchParams.set("user", name.value);
  link.href = address.href;
});
main.addEventListener("submit", (event) => void submitted(event));
