// The table of touches as typed arrays. A cell is one finger of one touch: touch * fingers + finger.
import type { DataReport } from "./report";

export interface Column {
  name: string;
  unit: string;
  labels: string[];
  at(cell: number): number;
}

export class Touches {
  readonly size: number;
  readonly cells: number;
  readonly fingers: number;
  readonly names: string[];
  readonly objects: string[];
  readonly inAll: number;
  readonly spacingMm: number;
  readonly number: Float64Array;
  readonly object: Uint32Array;
  readonly target: Float32Array;
  readonly approach: Float32Array;
  readonly lateral: Float32Array;
  readonly contact: Float32Array;
  readonly simulated: Float32Array;
  readonly residual: Float32Array;
  readonly after: Float32Array;
  readonly slices: Uint32Array[];
  readonly columns: Column[];

  constructor(data: DataReport) {
    const table = data.touch_table!;
    const floats = (values: number[]) => Float32Array.from(values, Number);
    this.size = table.touch.length;
    this.names = data.fingers;
    this.fingers = Math.max(1, table.residual.length / Math.max(1, this.size));
    this.cells = table.residual.length;
    this.objects = data.set?.objects ?? [];
    this.inAll = table.touches_in_all;
    this.spacingMm = table.spacing_mm;
    this.number = Float64Array.from(table.touch, Number);
    this.object = Uint32Array.from(table.object);
    this.target = floats(table.target_mm);
    this.approach = floats(table.approach);
    this.lateral = floats(table.lateral);
    this.contact = floats(table.contact_mm);
    this.simulated = floats(table.simulated);
    this.residual = floats(table.residual);
    this.after = floats(table.after);
    this.slices = table.slices.map((slice) => Uint32Array.from(slice.cells));
    const axes = ["x", "y", "z"].map((axis, k) => ({
      name: `contact_${axis}_mm`, unit: "mm", labels: [], at: (cell: number) => this.contact[3 * cell + k],
    }));
    this.columns = table.covariates.map((covariate) => {
      const values = floats(covariate.values);
      const step = values.length === this.size ? this.fingers : 1;
      return { name: covariate.name, unit: covariate.unit, labels: covariate.labels, at: (cell: number) => values[Math.floor(cell / step)] };
    });
    this.columns.push(...axes, {
      name: "touch_number", unit: "", labels: [], at: (cell: number) => this.number[Math.floor(cell / this.fingers)],
    });
  }

  residuals(improved: boolean): Float32Array { return improved ? this.after : this.residual; }
  touchOf(cell: number): number { return Math.floor(cell / this.fingers); }
  fingerOf(cell: number): number { return cell % this.fingers; }
  cellsOf(touch: number): number[] { return Array.from({ length: this.fingers }, (_, i) => touch * this.fingers + i); }

  // Square root of the sum of squares over the touch's fingers.
  norm(touch: number, values: Float32Array): number {
    let sum = 0;
    for (const cell of this.cellsOf(touch)) if (!Number.isNaN(values[cell])) sum += values[cell] ** 2;
    return Math.sqrt(sum);
  }

  find(number: number): number { return this.number.indexOf(number); }
}
