import { expect, test } from "vitest";
import { differences } from "./differences";
import { parsePageData } from "./load";
import type { DataReport, Report } from "./report";
import { Touches } from "./touches";
import { paint, refined, unpacked } from "../object/paint";

const nan = Number.NaN;

test("numbers that are not known are NaN, and a name stays a name", () => {
  const { report } = parsePageData('{"report":{"data":[{"session":"NaN","initial":{"rmse":"NaN"},"touch_table":{"residual":["NaN"]}}]},"words":{}}');
  expect(report.data[0].initial.rmse).toBeNaN();
  expect(report.data[0].session).toBe("NaN");
  expect(() => parsePageData("{}")).toThrow(/no report/);
});

test("covariates of touches hold for each of their fingers", () => {
  const table = new Touches({
    fingers: ["l", "r"], set: { objects: ["cup"] },
    touch_table: {
      touches_in_all: 2, spacing_mm: 30, touch: ["7", "9"], object: [0, 0], target_mm: [], approach: [], lateral: [], standoff_mm: [], contact_mm: [1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12],
      simulated: [1, -1, 1, -1], residual: [3, 4, "NaN", 1], after: [0, 0, 0, 0], slices: [{ cells: [1] }],
      covariates: [{ name: "session_time_s", unit: "s", labels: [], values: [10, 20] }, { name: "incidence_deg", unit: "deg", labels: [], values: [1, 2, 3, 4] }],
    },
  } as unknown as DataReport);
  const column = (name: string) => table.columns.find((one) => one.name === name)!;
  expect(column("session_time_s").at(3)).toBe(20);
  expect(column("incidence_deg").at(3)).toBe(4);
  expect(column("contact_y_mm").at(1)).toBe(5);
  expect(column("touch_number").at(2)).toBe(9);
  expect(table.norm(0, table.residual)).toBe(5);
  expect(table.norm(1, table.residual)).toBe(1);
  expect(table.find(9)).toBe(1);
});

const report = (rmse: number): Report => ({
  verdict: "ADEQUATE", model_name: "m", model_hash: "", steps: [], refitted: [],
  data: [{ kind: "TOUCHES", count: 3, noise_floor: 5000, initial: { rmse, heldout_rmse: nan, lack_of_fit_p: nan }, final: { rmse: 0, heldout_rmse: 0, lack_of_fit_p: 0 }, groups: [], where: [] }],
} as unknown as Report);

test("two reports differ in what reads differently", () => {
  const rows = differences(report(10000), report(20000));
  expect(rows.filter((row) => row.from !== row.to)).toEqual([{ part: "Error", name: "given model", from: "10.0\u00a0ms", to: "20.0\u00a0ms", change: "+100\u2009%" }]);
});

test("the paint follows the contacts and fades where there are none", () => {
  const mesh = refined([0, 0, 0, 100, 0, 0, 0, 100, 0], [0, 1, 2]);
  expect(mesh.triangles.length / 3).toBeGreaterThanOrEqual(3000);
  const colours = paint(mesh, Float32Array.from([0, 0, 0]), Float32Array.from([1]), 10, [200, 200, 200], () => [0, 0, 0]);
  expect(colours[0]).toBeLessThan(60);
  expect(colours[3]).toBe(200);
});

test("contacts with a value come in fours", () => {
  const { points, values, low, high } = unpacked([1, 2, 3, 10, 4, 5, 6, 30]);
  expect(Array.from(points)).toEqual([1, 2, 3, 4, 5, 6]);
  expect(Array.from(values)).toEqual([10, 30]);
  expect([low, high]).toEqual([10, 30]);
  expect(unpacked([0, 0, 0, 7]).high).toBeGreaterThan(7); // a scale has two ends
});
