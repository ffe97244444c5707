// Words and reaches for fingers.

/** True on a phone: no mouse, or a narrow window. The style sheets ask the same. */
export const isTouch = (): boolean =>
  window.matchMedia("(pointer: coarse), (max-width: 760px)").matches;

/** What a press is called: `Click` or `Tap`. */
export const Press = (): string => (isTouch() ? "Tap" : "Click");
/** The same within a sentence. */
export const press = (): string => (isTouch() ? "tap" : "click");
