// What the scripts know of the page beside the browser's own types.

// The script of the page itself, static/js/guard.js.
interface PageGuard {
  page: PageData;
  changed: (EventTarget | null)[]; // what was entered before the modules were there
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

// What a selector finds: the class of the tag that it ends with, which the browser checks. Without a tag, an element
// of the page's markup.
interface ParentNode {
  querySelector<S extends string>(selectors: S): PageElement<S> | null;
  querySelectorAll<S extends string>(selectors: S): NodeListOf<PageElement<S>>;
}
interface Element {
  closest<S extends string>(selectors: S): PageElement<S> | null;
}
type PageElement<S extends string> = string extends S
  ? HTMLElement
  : S extends `${infer First}, ${infer Rest}`
    ? IsClosed<First> extends true
      ? ElementOf<TagOf<First>> | PageElement<Rest>
      : HTMLElement
    : ElementOf<TagOf<S>>;
type ElementOf<Tag extends string> = Tag extends keyof HTMLElementTagNameMap
  ? HTMLElementTagNameMap[Tag]
  : Tag extends keyof SVGElementTagNameMap
    ? SVGElementTagNameMap[Tag]
    : HTMLElement;
type TagOf<S extends string> = S extends `${string} ${infer Rest}`
  ? TagOf<Rest>
  : Before<Before<Before<Before<S, ".">, "#">, "[">, ":">;
type IsClosed<S extends string> = S extends `${string}(${infer Inside}`
  ? Inside extends `${string})${infer After}`
    ? IsClosed<After>
    : false
  : true;
type Before<S extends string, Sign extends string> = S extends `${infer First}${Sign}${string}` ? First : S;

// The name of an event tells its class, whatever it is sent to.
interface EventTarget {
  addEventListener<K extends keyof WindowEventMap>(
    name: K,
    listener: (event: WindowEventMap[K]) => void,
    options?: AddEventListenerOptions,
  ): void;
}

interface WindowEventMap {
  visibilitychange: Event;
  gesturestart: UIEvent; // WebKit
}

interface Performance {
  getEntriesByType(type: "navigation"): PerformanceNavigationTiming[];
}

// The values that an event brings.
type Data = any; // the server's JSON: the tests of each widget kind check it
type Attributes = Record<string, Data>;
type Lamp = { state: string; text: string; since?: string; locks?: string; reason?: string };
type Show = (root: HTMLElement, value: Data) => void;
type Handlers = Record<string, (data?: Data) => void>;

type Click = { seen: string | null; at: string; press?: string; confirmation?: string };
type Press = Click & { id: string; inputs: Record<string, Data>; widget?: string; robots?: string };
type Receipt = { outcome: string; reason: string; id?: string; brief?: string };
type Entry = HTMLInputElement | HTMLSelectElement;
type Checkbox = HTMLInputElement & { type: "checkbox" };
type NumberInput = HTMLInputElement & { type: "text" | "range" };
type Limits = { min: string; max: string; step: string; isWhole: boolean };
type Judgement = { plain: string | null; problem: string | null };

type CellValue = { text: string; shape?: string; colour?: string };

// Of a trend: [number, lowest, highest, last, whether it begins a line].
type Column = [number, number, number, number, boolean];
// What the server says of it: null where a line ends.
type ColumnItem = [number, number] | [number, number, number, number] | null;
type TrendAnswer = {
  now: number;
  end: number;
  shift: string;
  width_s: number;
  zone_s: number;
  offset: string;
  pens: ColumnItem[][];
};
type Pen = {
  name: string;
  unit: string;
  digits: number | undefined;
  low: number | undefined;
  high: number | undefined;
  normal: number[] | undefined;
  axis: string;
  line: SVGPathElement;
  mark: SVGUseElement;
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

// The source of the page's state, in static/js/main.js.
interface PageSource {
  readonly seen: string;
  readonly ageMs: number;
  timeOf(event: Event): string;
  load<T>(module: Promise<T>, use: (module: T) => void): void;
}

// What the script of a widget kind registers, static/js/kinds/<kind>.js, or that of several kinds under the kind's name.
interface Hooks {
  equip?(root: HTMLElement, source: PageSource): void;
  show?: Record<string, Show>;
  lock?(root: HTMLElement, locked: boolean): void;
  values?(button: HTMLButtonElement, value: string): Record<string, Data>;
}

// The data of a page, app/web/pages/context.py.
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
  kinds: Record<string, string>; // the kinds of its widgets that have a script, and the name of that
  confirms: string[];
  sentences: Record<string, string>;
}
