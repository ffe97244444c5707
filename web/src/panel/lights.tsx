// Lights: their parameters, new ones, and those that go.

import type { JSX } from "preact";
import { type Fields, isFields } from "../form";
import { carried, carry, lightTarget } from "../gizmo";
import { chooseLight, chosenLight, lightOf, removeLight, showsLights } from "../light";
import { choices, type Store, scene } from "../store";
import { Section, Select } from "./section";
import { kindOf, Thing } from "./things";

/** Kinds that need no file to begin with. */
const isWhole = (kind: string): boolean =>
  !Object.values((choices.value?.examples.light?.[kind] ?? {}) as Fields).some(
    (value) => isFields(value) && ("table" in value || "image" in value),
  );

export function LightsSection({ store }: { store: Store }): JSX.Element | null {
  const info = scene.value;
  const form = choices.value?.forms.light;
  if (!info || !form) return null;
  const list = info.lights as Fields[];
  const index = Math.min(chosenLight.value ?? 0, list.length - 1);
  const named = (light: Fields, i: number): string => `${i} ${kindOf(form, light)}`;
  return (
    <Section
      title={`Lights (${list.length})`}
      open={showsLights.value}
      toggled={(isOpen) => {
        showsLights.value = isOpen;
        if (!isOpen) chosenLight.value = null;
      }}
    >
      {list.length > 1 && (
        <Select
          label="Which"
          value={String(index)}
          options={list.map((light, i) => ({ value: String(i), text: named(light, i) }))}
          change={(v) => chooseLight(Number(v))}
        />
      )}
      {index >= 0 && (
        <Thing
          family="light"
          index={index}
          thing={list[index]!}
          store={store}
          changeKind={(kind) => store.edit(`light.${index}`, lightOf(kind, list[index]!, store))}
        />
      )}
      {index >= 0 && (
        <div class="field buttons">
          {lightTarget(index) && (
            <button
              aria-pressed={carried.value === `light ${index}`}
              onClick={() => carry(store, `light ${index}`, () => lightTarget(index))}
            >
              Move it
            </button>
          )}
          <button title="Delete" onClick={() => removeLight(store, index)}>
            Remove
          </button>
        </div>
      )}
      <Select
        label="Add a light"
        value=""
        options={[
          { value: "", text: "choose …" },
          ...form.options.filter(isWhole).map((value) => ({ value })),
        ]}
        change={(kind) => {
          if (kind === "" || !store.rig) return;
          const added = list.length;
          store.edit(`light.${added}`, lightOf(kind, null, store));
          chooseLight(added);
        }}
      />
    </Section>
  );
}
