// What a formula may use, as the workbench says.
import { local } from "./live";

export interface FormulaWords {
  variables: { name: string; unit: string; meaning: string }[]; pixel_variables: { name: string; unit: string; meaning: string }[];
  functions: { usage: string; meaning: string }[]; constants: { name: string; meaning: string }[]; units: string[];
}
export interface FormulaParameter { name: string; value: string; unit: string; min: string; max: string }
export const formulaWords = async () => (await local("formula")).json() as Promise<FormulaWords>;
export const namesIn = async (expression: string) =>
  ((await (await local("formula", { method: "POST", body: JSON.stringify({ expression }) })).json()) as { names: { name: string }[] }).names.map((one) => one.name);
