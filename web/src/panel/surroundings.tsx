// Light from all around, what is seen behind the scene, and the sun.

import { useSignal } from "@preact/signals";
import type { JSX } from "preact";
import { useRef } from "preact/hooks";
import { filesOf } from "../drop";
import { Field } from "../form";
import type { Form } from "../protocol.gen";
import { lightBy } from "../send";
import { type Store, scene } from "../store";
import { type SunPosition, sunDirection, sunPosition } from "../sun";
import type { Vec3 } from "../vec";
import { Section, Select, Slider } from "./section";

/** The form of a colour, which is light if it has no upper bound. */
const color = (name: string, most: number | null): Form => ({
  name,
  kind: "color",
  range: null,
  limits: [0, most],
  default: null,
  is_textured: false,
  unit: "",
  doc: "",
  options: [],
  fields: [],
  tag: "",
  kinds: {},
  docs: {},
});

const ENVIRONMENTS = [
  { value: "none", text: "none" },
  { value: "color", text: "one colour" },
  { value: "sky", text: "studio" },
  { value: "day", text: "clear day" },
  { value: "picture", text: "picture …" },
];

const BACKGROUNDS = [
  { value: "environment", text: "the environment" },
  { value: "studio", text: "colour with shadow" },
  { value: "color", text: "colour" },
  { value: "transparent", text: "transparent" },
];

/** Elevation and side of the sun on a clear day that is chosen. */
const DAY = "sky:elevation=40,azimuth=135";

export function SurroundingsSection({ store }: { store: Store }): JSX.Element | null {
  const input = useRef<HTMLInputElement>(null);
  const over = useSignal(false);
  const info = scene.value;
  if (!info) return null;
  const { environment, light, rotation, background, color: behind } = info.surroundings;
  const strength = Math.max(...light);
  const choose = (kind: string): void => {
    if (kind === "picture") input.current?.click();
    else if (kind === "color") store.edit("environment", [0.5, 0.5, 0.5]);
    else store.edit("environment", kind === "day" ? DAY : kind);
  };
  return (
    <Section title="Surroundings">
      <fieldset
        class={over.value ? "target over" : "target"}
        aria-label="light from all around"
        onDragOver={(e) => {
          e.preventDefault();
          over.value = true;
        }}
        onDragLeave={() => (over.value = false)}
        onDrop={(e) => {
          e.preventDefault();
          e.stopPropagation();
          over.value = false;
          if (!e.dataTransfer) return;
          void filesOf(e.dataTransfer).then((files) => files[0] && lightBy(store, files[0].file));
        }}
      >
        <Select
          label="Light from"
          value={environment === "image" ? "image" : environment}
          options={[
            ...(environment === "image" ? [{ value: "image", text: "picture or sky" }] : []),
            ...ENVIRONMENTS,
          ]}
          change={choose}
        />
        <input
          ref={input}
          type="file"
          accept=".hdr,.exr,.pfm,image/*"
          hidden
          aria-label="picture of the surroundings"
          onChange={(e) => {
            const chosen = e.currentTarget.files?.[0];
            e.currentTarget.value = "";
            if (chosen) void lightBy(store, chosen);
          }}
        />
        {environment === "color" && (
          <Field
            label="radiance"
            value={light}
            path=""
            form={color("radiance", null)}
            change={(_, value) => store.edit("environment", value)}
          />
        )}
        {environment === "image" && (
          <>
            <Slider
              label="Strength"
              fallback={1}
              min={0}
              max={4}
              step={0.02}
              value={strength}
              change={(v) => {
                const next = Math.max(0, v);
                const scale = strength > 0 ? light.map((x) => (x / strength) * next) : [v, v, v];
                store.edit("environment.scale", scale);
              }}
            />
            <Slider
              label="Rotation"
              unit="°"
              fallback={0}
              min={-180}
              max={180}
              step={1}
              value={rotation}
              change={(v) => store.edit("environment.rotation", v)}
            />
          </>
        )}
      </fieldset>
      <Select
        label="Background"
        value={background}
        options={BACKGROUNDS}
        change={(kind) => store.edit("background", kind === "color" ? [0.2, 0.2, 0.2] : kind)}
      />
      {behind && (
        <Field
          label="behind"
          value={behind}
          path=""
          form={color("behind", 1)}
          change={(_, value) => store.edit("background.color", value)}
        />
      )}
      <Sun store={store} />
    </Section>
  );
}

/** The first directional light, as a sun. */
function Sun({ store }: { store: Store }): JSX.Element | null {
  const info = scene.value!;
  const up = info.up as Vec3;
  const sun = info.lights.findIndex((light) => light.light === "directional");
  if (sun < 0) return null;
  const position = sunPosition(info.lights[sun]!.direction as Vec3, up);
  const move = (next: Partial<SunPosition>): void => {
    const direction = sunDirection({ ...position, ...next }, up).map((v) =>
      Number(v.toPrecision(6)),
    );
    store.edit(`light.${sun}.direction`, direction);
  };
  return (
    <>
      <Slider
        label="Sun height"
        unit="°"
        min={-90}
        max={90}
        step={0.5}
        value={position.height}
        change={(height) => move({ height })}
      />
      <Slider
        label="Sun side"
        unit="°"
        min={-180}
        max={180}
        step={1}
        value={position.side}
        change={(side) => move({ side })}
      />
    </>
  );
}
