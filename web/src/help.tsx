// The keys.

import type { JSX } from "preact";
import { useLayoutEffect, useRef } from "preact/hooks";

const KEYS: [string, string][] = [
  ["Drag", "turn: down raises the camera"],
  ["Right or Shift + drag", "move what is under the hand"],
  ["Alt + drag", "look around"],
  ["Wheel", "come closer to what is under the pointer"],
  ["+ and -", "come closer or go away"],
  ["Two fingers", "move, and come closer"],
  ["Double-click", "turn about this point and focus on it"],
  ["Click", "what is here?"],
  ["X", "why does the pixel under the pointer look so?"],
  ["W A S D, Q E", "fly; with Shift four times as fast"],
  ["Arrows", "turn"],
  ["F", "see what was clicked on, or the subject"],
  ["Home, Shift+F", "see all, with the ground"],
  ["0", "reset the camera"],
  ["O", "orthographic or perspective"],
  ["1 to 6", "front, back, right, left, top, bottom"],
  ["C", "compare with the picture as it is now"],
  ["B, held", "the reference in place of the picture"],
  ["M", "measure"],
  ["I, H", "numbers under the pointer, histogram"],
  ["Delete", "remove the chosen light"],
  ["P", "panel"],
  ["Ctrl+Z, Ctrl+Shift+Z", "undo, redo: changes and moves of the camera"],
  ["Escape", "close, or end the tool"],
];

export function Help(props: { close(): void }): JSX.Element {
  const dialog = useRef<HTMLDialogElement>(null);
  useLayoutEffect(() => dialog.current?.showModal(), []);
  return (
    <dialog
      ref={dialog}
      onClose={props.close}
      // Closed here at once: the event of a dialog that closes itself comes later, when the next
      // key may have asked for it again.
      onKeyDown={(e) => {
        if (e.key !== "Escape") return;
        e.preventDefault();
        props.close();
      }}
      // A press on the backdrop is one on the dialog itself.
      onClick={(e) => e.target === e.currentTarget && props.close()}
      aria-label="keys"
    >
      <div class="keys">
        <table>
          <tbody>
            {KEYS.map(([key, what]) => (
              <tr>
                <th>
                  <kbd>{key}</kbd>
                </th>
                <td>{what}</td>
              </tr>
            ))}
          </tbody>
        </table>
      </div>
      <form>
        <button type="button" onClick={props.close}>
          Close
        </button>
      </form>
    </dialog>
  );
}
