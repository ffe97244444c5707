// Materials: the one of what was picked, all others, and one for surfaces that have none.

import { useSignal } from "@preact/signals";
import type { JSX } from "preact";
import type { Fields } from "../form";
import { freshName } from "../names";
import { choices, picked, type Store, scene } from "../store";
import { Section, Select } from "./section";
import { KindSelect, ofKind, Thing } from "./things";

/** The grey of surfaces without a material. */
const GREY = 0.55;

/** Gives a material of this kind to all surfaces without one. */
function dress(store: Store, kind: string): void {
  const info = scene.value!;
  const [number, root] = [info.materials.length, info.nodes[0]!.id];
  const grey = { material: "diffuse", reflectance: { factor: [GREY, GREY, GREY], texture: null } };
  const own = ofKind("material", { kind: grey }, kind);
  const name = freshName(
    "material",
    info.materials.map((material) => material.name),
  );
  store.edits([
    [`material.${number}`, { name, kind: own }],
    [`node.${root}.material`, number],
  ]);
}

/** The way from grey to a material. */
function Bare({ store, text }: { store: Store; text: string }): JSX.Element {
  const first = choices.value?.forms.material?.options.includes("open-pbr")
    ? "open-pbr"
    : "diffuse";
  return (
    <>
      <p class="quiet">{text}</p>
      <div class="field">
        <button class="accent" onClick={() => dress(store, first)}>
          Give it a material
        </button>
      </div>
      <KindSelect
        family="material"
        label="of the kind"
        none="choose …"
        now=""
        change={(kind) => dress(store, kind)}
      />
    </>
  );
}

export function MaterialsSection({ store }: { store: Store }): JSX.Element | null {
  const own = useSignal<number | null>(null);
  const info = scene.value;
  if (!info || info.nodes.length === 0) return null;
  const list = info.materials as Fields[];
  const hit = picked.value;
  const isBare = hit !== null && hit.material === null;
  const chosen = own.value ?? hit?.material ?? 0;
  const index = Math.min(chosen, list.length - 1);
  const [only] = list;
  const title =
    list.length > 1
      ? `Materials (${list.length})`
      : only?.name
        ? `Material: ${only.name}`
        : "Material";
  return (
    <Section title={title} open={list.length <= 1 || hit !== null}>
      {list.length === 0 ? (
        <Bare store={store} text="Nothing here has a material: all is grey." />
      ) : (
        <>
          {isBare && <Bare store={store} text="What you picked has no material." />}
          {list.length > 1 && (
            <Select
              label="Which"
              value={String(index)}
              options={list.map((m, i) => ({
                value: String(i),
                text: String(m.name || `material ${i}`),
              }))}
              change={(v) => (own.value = Number(v))}
            />
          )}
          {!(isBare && own.value === null) && (
            <Thing
              family="material"
              index={index}
              thing={list[index]!}
              store={store}
              changeKind={(kind) =>
                store.edit(`material.${index}.kind`, ofKind("material", list[index]!, kind))
              }
            />
          )}
        </>
      )}
    </Section>
  );
}
