// A number as its reader writes it: with a true minus sign and the decimal sign of the page's language. What an input
// holds has a hyphen and a point.
export const DECIMAL = document.documentElement.dataset.decimal ?? ".";

export function numberText(text) {
  return text.replace("-", "−").replace(".", DECIMAL);
}
