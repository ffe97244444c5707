// Which keys belong to a control of the page.

/** True if keys on this element belong to it: they are text, or choose from a list. */
export function takesKeys(element: HTMLElement, key: string): boolean {
  if (element.isContentEditable || /^(SELECT|TEXTAREA)$/.test(element.tagName)) return true;
  if (element.tagName !== "INPUT") return false;
  const { type } = element as HTMLInputElement;
  if (type === "range") return /^(Arrow|Page|Home|End)/.test(key);
  return !/^(checkbox|radio|button|color|file|reset|submit)$/.test(type);
}

/** True for a key that belongs to the control that has the focus. */
export const isTyping = (event: KeyboardEvent): boolean =>
  takesKeys(event.target as HTMLElement, event.key);
