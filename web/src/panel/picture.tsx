// How the picture is made and shown.

import type { JSX } from "preact";
import { NumberInput } from "../number";
import type { SettingForm, ViewInfo } from "../protocol.gen";
import { choices, costs, exposure, type Store, tonemap, view } from "../store";
import { Section, Select, Slider } from "./section";

/** A setting of the render that has no control of its own. */
function Setting(props: { setting: SettingForm; now: ViewInfo; store: Store }): JSX.Element {
  const { setting, now, store } = props;
  const label = setting.name.replaceAll("_", " ");
  const value = now.settings[setting.name] ?? "";
  const send = (wish: unknown): void =>
    store.send({ type: "set", name: setting.name, value: wish });
  if (setting.options.length > 0) {
    const options = setting.options.map((name) => ({ value: name }));
    const usual = { value: "", text: `default (${setting.default})` };
    return (
      <Select
        label={label}
        value={value}
        options={[usual, ...options]}
        change={(name) => send(name === "" ? null : name)}
      />
    );
  }
  return (
    <div class="field" title={setting.doc}>
      <span>{label}</span>
      <NumberInput
        label={label}
        value={value === "" || !Number.isFinite(Number(value)) ? null : Number(value)}
        fallback={null}
        placeholder={setting.default}
        change={send}
      />
    </div>
  );
}

export function PictureSection({ store }: { store: Store }): JSX.Element | null {
  const [now, names] = [view.value, choices.value];
  if (!now || !names) return null;
  const options = (list: string[]): { value: string }[] => list.map((value) => ({ value }));
  return (
    <Section title="Picture">
      <Slider
        label="Exposure"
        unit="stops"
        fallback={0}
        min={-8}
        max={8}
        step={0.1}
        value={exposure.value}
        change={(v) => store.setDisplay({ exposure: v })}
      />
      <Select
        label="Tone map"
        value={tonemap.value}
        options={options(names.tonemaps)}
        change={(v) => store.setDisplay({ tonemap: v })}
      />
      <Select
        label="Show"
        value={now.aov}
        options={[{ value: "", text: "light" }, ...options(names.aovs)]}
        change={(aov) => store.send({ type: "render", aov })}
      />
      <Select
        label="Integrator"
        value={now.integrator}
        options={options(names.integrators)}
        change={(integrator) => store.send({ type: "render", integrator })}
      />
      <Slider
        label="Samples"
        min={1}
        max={1024}
        step={1}
        value={now.spp}
        change={(spp) => store.send({ type: "render", spp: Math.round(spp) })}
      />
      <Slider
        label="Bounces"
        min={0}
        max={64}
        step={1}
        value={now.max_depth}
        change={(d) => store.send({ type: "render", max_depth: Math.round(d) })}
      />
      <Select
        label="Accelerator"
        value={now.accelerator}
        options={options(names.accelerators)}
        change={(accelerator) => store.send({ type: "render", accelerator })}
      />
      <details class="more">
        <summary>More settings</summary>
        {names.settings.map((setting) => (
          <Setting key={setting.name} setting={setting} now={now} store={store} />
        ))}
      </details>
      <button onClick={() => (costs.value = !costs.value)} aria-pressed={costs.value}>
        Compare acceleration structures
      </button>
    </Section>
  );
}
