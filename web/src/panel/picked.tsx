// What was clicked on.

import type { JSX } from "preact";
import { carried, carry, selectedTarget } from "../gizmo";
import type { PickedHit } from "../protocol.gen";
import { selection } from "../select";
import { picked, pickedPixel, type Store, scene } from "../store";
import { Section } from "./section";

function Facts({ hit }: { hit: PickedHit }): JSX.Element {
  const number = (v: number): string => Number(v.toPrecision(5)).toString();
  return (
    <table class="facts">
      <tbody>
        <tr>
          <th>Object</th>
          <td>{hit.path.filter(Boolean).join(" › ") || "unnamed"}</td>
        </tr>
        <tr>
          <th>Material</th>
          <td>{hit.material === null ? "none" : hit.material_name || "unnamed"}</td>
        </tr>
        <tr>
          <th>Distance</th>
          <td>{number(hit.distance)}</td>
        </tr>
        <tr>
          <th>Position</th>
          <td>{hit.position.map(number).join(", ")}</td>
        </tr>
        <tr>
          <th>Normal</th>
          <td>{hit.normal.map(number).join(", ")}</td>
        </tr>
        <tr>
          <th>Face</th>
          <td>{hit.primitive}</td>
        </tr>
      </tbody>
    </table>
  );
}

/** What can be done with what is selected. */
function Actions({ store }: { store: Store }): JSX.Element | null {
  const place = selection.value?.place;
  const isolated = scene.value?.isolated ?? null;
  if (!place) return null;
  const show = (what: string, value: boolean, node = place.node): void =>
    store.edit(`node.${node}.${what}`, value);
  return (
    <div class="field buttons">
      <button
        aria-pressed={carried.value === "selection"}
        title={`Move or turn ${place.name || "the object"}`}
        onClick={() => carry(store, "selection", selectedTarget)}
      >
        Move
      </button>
      <button
        aria-pressed={isolated !== null}
        title="Show nothing else but what shines, and back"
        onClick={() => show("isolated", isolated === null, isolated ?? place.node)}
      >
        Isolate
      </button>
      <button onClick={() => show("visible", false)}>Hide</button>
    </div>
  );
}

export function PickedSection({ store }: { store: Store }): JSX.Element | null {
  const hit = picked.value;
  if (!hit && !selection.value?.place) return null;
  return (
    <Section title="Picked">
      {hit ? <Facts hit={hit} /> : <p class="quiet">{selection.value!.place!.name || "unnamed"}</p>}
      {hit && (
        <div class="field">
          <button
            class="accent"
            onClick={() => pickedPixel.value && void store.explain(pickedPixel.value)}
          >
            Why does it look so?
          </button>
        </div>
      )}
      <Actions store={store} />
    </Section>
  );
}
