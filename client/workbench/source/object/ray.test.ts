import { expect, test } from "vitest";
import { firstHit } from "./ray";

// A square in the plane z = 1, and another one behind it in z = 3.
const vertices = [0, 0, 1, 2, 0, 1, 2, 2, 1, 0, 2, 1, 0, 0, 3, 2, 0, 3, 2, 2, 3, 0, 2, 3];
const triangles = [4, 5, 6, 4, 6, 7, 0, 1, 2, 0, 2, 3];

test("the nearest of what lies ahead is met, from either side", () => {
  expect(firstHit([1, 0.5, -1], [0, 0, 1], vertices, triangles)).toBeCloseTo(2);
  expect(firstHit([1, 0.5, 5], [0, 0, -1], vertices, triangles)).toBeCloseTo(2);
  expect(firstHit([1, 0.5, 2], [0, 0, 1], vertices, triangles)).toBeCloseTo(1);
});

test("what lies behind, beside or along is not met", () => {
  expect(firstHit([1, 0.5, 4], [0, 0, 1], vertices, triangles)).toBe(Infinity);
  expect(firstHit([3, 0.5, -1], [0, 0, 1], vertices, triangles)).toBe(Infinity);
  expect(firstHit([-1, 0.5, 1], [1, 0, 0], vertices, triangles)).toBe(Infinity);
});
