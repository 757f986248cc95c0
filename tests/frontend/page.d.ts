// What the scripts know of the page beside the browser's own types.

// The script of the page itself, static/js/guard.js.
interface PageGuard {
  page: PageData;
  isBroken: boolean;
  fail(error?: unknown): void;
  started(): void;
  reload(atOnce?: boolean): void;
  recall(name: string): string | null | undefined;
  keep(name: string, value: string | number | null): void;
  onFail?: () => void;
}
declare var pageGuard: PageGuard;

interface Window {
  CSSLayerBlockRule?: unknown;
  operatorPanel?: { eventAgeMs(): number };
}

// Selectors that are no names of elements find elements of the page's markup.
interface ParentNode {
  querySelector(selectors: string): HTMLElement | null;
  querySelectorAll(selectors: string): NodeListOf<HTMLElement>;
}
interface Element {
  closest(selectors: string): HTMLElement | null;
}

// The values that an event brings.
type Data = any; // the server's JSON: the tests of each widget kind check it
type Attributes = Record<string, Data>;
type Lamp = { state: string; text: string; since?: string; locks?: string; reason?: string };
type Show = (root: HTMLElement, value: Data) => void;
type Handlers = Record<string, (data: Data) => void>;

type Receipt = { outcome: string; reason: string; id?: string };
type Entry = HTMLInputElement | HTMLSelectElement;
type Limits = { min: string; max: string; step: string; isWhole: boolean };
type Judgement = { plain: string | null; problem: string | null };

type CellValue = { text: string; shape?: string; colour?: string };

// Of a trend: [number, lowest, highest, last, whether it begins a line].
type Column = [number, number, number, number, boolean];
type Pen = {
  name: string | null;
  unit: string | undefined;
  digits: number | undefined;
  low: number | undefined;
  high: number | undefined;
  normal: number[] | undefined;
  line: Element | undefined;
  mark: Element | undefined;
};
type View = {
  begin: number;
  end: number;
  width: number;
  zone: number;
  offset: string;
  shift: string;
  span: number;
  live: boolean;
};

// What the script of a widget kind registers, static/js/kinds/<kind>.js.
interface Hooks {
  equip?(root: HTMLElement, source: import("../../static/js/source.js").Source): void;
  show?: Record<string, Show>;
  lock?(root: HTMLElement, locked: boolean): void;
  values?(button: HTMLButtonElement, value: string): Record<string, Data>;
}

// The elements that some selectors find.
interface PageElements {
  "#control": HTMLFormElement;
  ".cancel": HTMLButtonElement;
  ".hold": HTMLButtonElement;
  "dialog.ask": HTMLDialogElement;
}
type PageElement<S extends string> = S extends keyof PageElements
  ? PageElements[S]
  : S extends keyof HTMLElementTagNameMap
    ? HTMLElementTagNameMap[S]
    : HTMLElement;

// The data of a page, app/web/rendering/page_data.py.
interface PageData {
  page: string;
  base: string;
  embed: string;
  revision: string;
  seen: string;
  now: number;
  keyboard: string;
  sounds: boolean;
  dimAfterS: number | null;
  sections: string[];
  kinds: string[];
  sentences: Record<string, string>;
}
