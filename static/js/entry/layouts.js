// The keyboard's letters, in a table for each language; a language without one has the English.
const DIGITS = "1234567890";

/** @type {Record<string, string[]>} */
export const LAYOUTS = {
  en: [DIGITS, "qwertyuiop", "asdfghjkl", "zxcvbnm,.-"],
  de: [`${DIGITS}ß`, "qwertzuiopü", "asdfghjklöä", "yxcvbnm,.-"],
};

export const SIGNS = [DIGITS, '!"#$%&/()=', "+*'~^@€°<>", "?:;_|\\[]{}"];

// Capitals that are no capital letter of the same key.
/** @type {Record<string, string>} */
const CAPITALS = { ß: "ẞ", ",": ";", ".": ":", "-": "_" };

/** @param {string} letter */
export function capital(letter) {
  return CAPITALS[letter] ?? letter.toUpperCase();
}

/** @param {string} language */
export function layoutOf(language) {
  return LAYOUTS[language] ?? LAYOUTS[language.split("-")[0]] ?? LAYOUTS.en;
}
