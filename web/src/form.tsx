// Forms made from declarations: every declared parameter of a material or light can be edited.

import type { JSX } from "preact";
import type { Form } from "./protocol.gen";
import { linearToSrgb } from "./tonemap";

type Json = null | boolean | number | string | Json[] | { [key: string]: Json };

interface FieldProps {
  label: string;
  value: Json;
  /** What the parameter is declared to be; none for what stands inside of measured data. */
  form?: Form | undefined;
  /** Path of the parameter, without the family. */
  path: string;
  change(path: string, value: Json): void;
}

const readable = (name: string): string => name.replaceAll("_", " ");

/** The words before a field, with its unit. */
const caption = (label: string, form?: Form): string =>
  form?.unit ? `${readable(label)} (${form.unit})` : readable(label);

const isColor = (value: Json, form?: Form): value is number[] =>
  form?.kind === "color" &&
  Array.isArray(value) &&
  value.length === 3 &&
  value.every((v) => typeof v === "number");

/** The form of what stands inside of a parameter: in a group, or in the value's variant. */
export function inside(
  form: Form | undefined,
  value: { [key: string]: Json },
  key: string,
): Form | undefined {
  if (!form) return undefined;
  const named = (fields: Form[] | undefined): Form | undefined =>
    fields?.find((field) => field.name === key);
  const kind = form.tag ? value[form.tag] : undefined;
  const found =
    named(form.fields) ?? (typeof kind === "string" ? named(form.kinds[kind]) : undefined);
  if (found || form.tag !== "" || !(key in form.kinds)) return found;
  // The name of the variant is the key around its parameters.
  return (
    form.kinds[key]!.find((field) => field.name === "") ?? {
      ...form,
      kind: "other",
      fields: form.kinds[key]!,
      kinds: {},
    }
  );
}

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

function NumberField({
  label,
  value,
  path,
  change,
  form,
}: FieldProps & { value: number }): JSX.Element {
  const range = form?.range;
  const set = (event: JSX.TargetedEvent<HTMLInputElement>): void => {
    const next = Number(event.currentTarget.value);
    if (event.currentTarget.value !== "" && Number.isFinite(next)) change(path, next);
  };
  return (
    <label class="field" title={form?.doc}>
      <span>{caption(label, form)}</span>
      {range && (
        <input
          type="range"
          min={range[0]}
          max={range[1]}
          step={(range[1]! - range[0]!) / 200}
          value={value}
          onInput={set}
          aria-label={readable(label)}
        />
      )}
      <input type="number" step="any" value={value} onChange={set} aria-label={readable(label)} />
    </label>
  );
}

function ColorField({
  label,
  value,
  path,
  change,
  form,
}: FieldProps & { value: number[] }): JSX.Element {
  return (
    <div class="field" title={form?.doc}>
      <span>{caption(label, form)}</span>
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
  const { label, value, path, change, form } = props;
  if (typeof value === "number") return <NumberField {...props} value={value} />;
  if (typeof value === "boolean") {
    return (
      <label class="field" title={form?.doc}>
        <span>{readable(label)}</span>
        <input
          type="checkbox"
          checked={value}
          onChange={(e) => change(path, e.currentTarget.checked)}
        />
      </label>
    );
  }
  if (isColor(value, form)) return <ColorField {...props} value={value} />;
  if (Array.isArray(value)) {
    return (
      <div class="field" title={form?.doc}>
        <span>{caption(label, form)}</span>
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
      return (
        <Field
          label={label}
          value={value.factor!}
          path={`${path}.factor`}
          change={change}
          form={form}
        />
      );
    }
    return (
      <fieldset title={form?.doc}>
        <legend>{readable(label)}</legend>
        {keys.map((key) => (
          <Field
            key={key}
            label={key}
            value={value[key]!}
            path={`${path}.${key}`}
            change={change}
            form={key === "factor" ? form : inside(form, value, key)}
          />
        ))}
      </fieldset>
    );
  }
  if (typeof value === "string" && form?.kind === "choice") {
    return (
      <label class="field" title={form.doc}>
        <span>{readable(label)}</span>
        <select
          value={value}
          aria-label={readable(label)}
          onChange={(e) => change(path, e.currentTarget.value)}
        >
          {form.options.map((option) => (
            <option value={option}>{option}</option>
          ))}
        </select>
      </label>
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
