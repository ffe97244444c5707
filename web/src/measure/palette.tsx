// The measuring tool's own panel over the picture: what is measured, and what was.

import type { JSX } from "preact";
import type { Store } from "../store";
import { tool, use } from "../tool";
import { KINDS, result, table } from "./geometry";
import { kind, measureBy, measures, NAME } from "./tool";

async function copy(store: Store, text: string): Promise<void> {
  try {
    await navigator.clipboard.writeText(text);
    store.notice(`Copied: ${text.replaceAll("\t", "  ")}`);
  } catch {
    store.notice(text.replaceAll("\t", "  "));
  }
}

export function MeasurePalette({ store }: { store: Store }): JSX.Element | null {
  if (tool.value?.name !== NAME) return null;
  return (
    <section class="palette" aria-label="measuring">
      <fieldset class="row" aria-label="what is measured">
        {KINDS.map((k) => (
          <button aria-pressed={kind.value === k.kind} onClick={() => measureBy(store, k.kind)}>
            {k.name}
          </button>
        ))}
        <button onClick={() => use(null)}>Done</button>
      </fieldset>
      {measures.value.length > 0 && (
        <>
          <ul aria-label="measures, in units of the scene">
            {measures.value.map((measure) => {
              const { label, details } = result(measure);
              return (
                <li key={measure.id}>
                  <span>
                    {measure.kind} <strong>{label}</strong>
                    {details.map(([name, value]) => (
                      <small>
                        {" "}
                        {name} {value}
                      </small>
                    ))}
                  </span>
                  <button
                    aria-label={`copy ${measure.kind} ${label}`}
                    onClick={() => void copy(store, table([measure]))}
                  >
                    Copy
                  </button>
                  <button
                    aria-label={`remove ${measure.kind} ${label}`}
                    onClick={() =>
                      (measures.value = measures.value.filter((m) => m.id !== measure.id))
                    }
                  >
                    ×
                  </button>
                </li>
              );
            })}
          </ul>
          <div class="row">
            <button onClick={() => void copy(store, table(measures.value))}>Copy all</button>
            <button onClick={() => (measures.value = [])}>Clear all</button>
            <small class="quiet">in units of the scene</small>
          </div>
        </>
      )}
    </section>
  );
}
