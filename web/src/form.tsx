// Forms made from the parameters themselves: every declared parameter of a material or light can be changed.

import type { JSX } from "preact";
import { linearToSrgb } from "./tonemap";

type Json = null | boolean | number | string | Json[] | { [key: string]: Json };

interface FieldProps {
  label: string;
  value: Json;
  /** Path of the parameter, without the family. */
  path: string;
  change(path: string, value: Json): void;
}

const readable = (name: string): string => name.replaceAll("_", " ");

const isColor = (value: Json): value is number[] =>
  Array.isArray(value) && value.length === 3 && value.every((v) => typeof v === "number");

/** Names of parameters that are vectors, not colours. */
const VECTORS = /position|direction|axes|center|lengths|eye|up|towards/;

const toHex = (rgb: number[]): string => {
  const most = Math.max(1, ...rgb);
  return (
    "#" +
    rgb
      .map((v) =>
        Math.round(linearToSrgb(Math.max(0, v / most)) * 255)
          .toString(16)
          .padStart(2, "0"),
      )
      .join("")
  );
};

const fromHex = (hex: string, before: number[]): number[] => {
  const most = Math.max(1, ...before);
  return [1, 3, 5].map((i) => {
    const s = parseInt(hex.slice(i, i + 2), 16) / 255;
    const linear = s <= 0.04045 ? s / 12.92 : ((s + 0.055) / 1.055) ** 2.4;
    return Number((linear * most).toPrecision(4));
  });
};

function NumberField({ label, value, path, change }: FieldProps & { value: number }): JSX.Element {
  const unit = value >= 0 && value <= 1;
  const set = (event: JSX.TargetedEvent<HTMLInputElement>): void => {
    const next = Number(event.currentTarget.value);
    if (event.currentTarget.value !== "" && Number.isFinite(next)) change(path, next);
  };
  return (
    <label class="field">
      <span>{readable(label)}</span>
      {unit && (
        <input
          type="range"
          min="0"
          max="1"
          step="0.005"
          value={value}
          onInput={set}
          aria-label={readable(label)}
        />
      )}
      <input type="number" step="any" value={value} onChange={set} aria-label={readable(label)} />
    </label>
  );
}

function ColorField({ label, value, path, change }: FieldProps & { value: number[] }): JSX.Element {
  return (
    <div class="field">
      <span>{readable(label)}</span>
      <input
        type="color"
        value={toHex(value)}
        aria-label={readable(label)}
        onInput={(e) => change(path, fromHex(e.currentTarget.value, value))}
      />
      {value.map((v, i) => (
        <input
          type="number"
          step="any"
          class="narrow"
          value={Number(v.toPrecision(4))}
          aria-label={`${readable(label)} ${"red green blue".split(" ")[i]}`}
          onChange={(e) =>
            change(
              path,
              value.map((old, j) => (j === i ? Number(e.currentTarget.value) : old)),
            )
          }
        />
      ))}
    </div>
  );
}

/** A field for one parameter, or a group of fields. */
export function Field(props: FieldProps): JSX.Element | null {
  const { label, value, path, change } = props;
  if (typeof value === "number") return <NumberField {...props} value={value} />;
  if (typeof value === "boolean") {
    return (
      <label class="field">
        <span>{readable(label)}</span>
        <input
          type="checkbox"
          checked={value}
          onChange={(e) => change(path, e.currentTarget.checked)}
        />
      </label>
    );
  }
  if (isColor(value) && !VECTORS.test(label)) return <ColorField {...props} value={value} />;
  if (Array.isArray(value)) {
    return (
      <div class="field">
        <span>{readable(label)}</span>
        {value.map((v, i) =>
          typeof v === "number" ? (
            <input
              type="number"
              step="any"
              class="narrow"
              value={Number(v.toPrecision(6))}
              aria-label={`${readable(label)} ${i + 1}`}
              onChange={(e) =>
                change(
                  path,
                  value.map((old, j) => (j === i ? Number(e.currentTarget.value) : old)),
                )
              }
            />
          ) : (
            <em>{JSON.stringify(v)}</em>
          ),
        )}
      </div>
    );
  }
  if (value !== null && typeof value === "object") {
    // A factor without a texture is shown as the parameter itself.
    const keys = Object.keys(value);
    if ("factor" in value && keys.every((key) => key === "factor" || value[key] === null)) {
      return <Field label={label} value={value.factor!} path={`${path}.factor`} change={change} />;
    }
    return (
      <fieldset>
        <legend>{readable(label)}</legend>
        {keys.map((key) => (
          <Field key={key} label={key} value={value[key]} path={`${path}.${key}`} change={change} />
        ))}
      </fieldset>
    );
  }
  if (typeof value === "string") {
    return (
      <div class="field">
        <span>{readable(label)}</span>
        <em>{value}</em>
      </div>
    );
  }
  return null;
}
