// The side panel: render settings and the contents of the scene.

import type { JSX } from "preact";
import { type Store, scene, steers } from "../store";
import { CameraSection } from "./camera";
import { LightsSection } from "./lights";
import { MaterialsSection } from "./materials";
import { PickedSection } from "./picked";
import { PictureSection } from "./picture";
import { Section } from "./section";
import { SurroundingsSection } from "./surroundings";
import { TreeSection } from "./tree";

export function Panel({ store }: { store: Store }): JSX.Element {
  const info = scene.value;
  return (
    <aside class={steers.value ? "panel" : "panel watching"} aria-label="settings">
      <PickedSection store={store} />
      <MaterialsSection store={store} />
      <PictureSection store={store} />
      <CameraSection store={store} />
      <SurroundingsSection store={store} />
      <LightsSection store={store} />
      <TreeSection store={store} />
      {info && info.warnings.length > 0 && (
        <Section title={`Warnings (${info.warnings.length})`} open={false}>
          <ul class="warnings">
            {info.warnings.slice(0, 100).map((w) => (
              <li>{w}</li>
            ))}
          </ul>
        </Section>
      )}
    </aside>
  );
}
