// The report as protobuf JSON has it (proto/touchstone/v1/diagnosis.proto), and the sentences that come with it
// (client/report/html_report.cpp). Every primitive and repeated field is there; messages may be absent.

export type Kind = "TOUCHES" | "PHOTOGRAPHS" | "BOARDS" | "DISTRIBUTIONS" | "KIND_UNSPECIFIED";

export interface Quality { rmse: number; heldout_rmse: number; lack_of_fit_p: number }

export interface Value {
  name: string; value: number; std_error: number; unit: string; finger: string; object: string;
  lower: number; upper: number; before?: number; alone: { kind: Kind; std_error: number }[];
}

export interface Scope { kind: string; objects: string[] }

export interface Step {
  effect: string; equivalent: string[]; probability: number; parameters: Value[]; gain_nats: number; meaning: string;
  check_on_rig: string; remedy: string; discriminating_measurement: string; scope?: Scope; words: string; shown_by: Kind[];
}

export interface Candidate {
  effect: string; parameters: Value[]; probability: number; rmse: number; heldout_rmse: number; note: string; scope?: Scope;
}

export interface Slice {
  slice: string; count: number; mean_residual: number; share_of_excess_error: number; words: string; rmse: number;
}

export interface Group {
  kind: string; name: string; count: number; rmse: number; mean_residual: number; share_of_excess_error: number;
}

export interface CurveBin {
  centre: number; mean_residual: number; std_error: number; after: number; count: number; finger: string;
}

export interface Curve {
  covariate: string; unit: string; bins: CurveBin[]; p: number; p_after: number;
  fingers: { finger: string; p: number; p_after: number }[];
}

export interface Histogram {
  quantity: string; object: string; edges: number[]; measured: number[]; simulated: number[]; improved: number[];
  p_simulated: number; p_improved: number;
}

export interface Unexplained {
  covariates: { name: string; p: number; gain_nats: number }[];
  formula: string; formula_yaml: string; parameters: Value[]; rmse: number; heldout_rmse: number; heldout_gain: number;
  lookup_yaml: string; nearest_formula: string; nearest_formula_share: number; words: string; model_yaml: string;
  curve?: {
    covariate: string; covariate_unit: string; unit: string; knots: number[]; curves: { finger: string; values: number[] }[];
  };
}

export interface PhotographMap {
  image: string; object: string; measured_png: string; before_png: string; after_png: string; residual_before_png: string;
  residual_after_png: string; residual_scale: number;
}

export interface Photographs {
  silhouette_iou: number; silhouette_iou_after: number; contour_distance_px: number; contour_distance_after_px: number;
  photographs: {
    image: string; object: string; rmse: number; rmse_after: number; mean_residual: number; silhouette_iou: number;
    contour_distance_px: number;
  }[];
  maps: PhotographMap[];
}

export interface Distributions {
  energy_distance: number; p: number; simulated_touches: number; plan: string; compatible_effects: string[];
  statistics: { name: string; measured: number; simulated: number; unit: string; p: number }[];
  findings: { words: string; p: number; compatible_effects: string[] }[];
}

export interface TouchTable {
  touches_in_all: number; spacing_mm: number; touch: string[]; object: number[]; target_mm: number[]; approach: number[];
  lateral: number[]; standoff_mm: number[]; contact_mm: number[]; simulated: number[]; residual: number[]; after: number[];
  covariates: { name: string; unit: string; labels: string[]; values: number[] }[];
  slices: { cells: number[] }[];
}

export interface DataReport {
  kind: Kind; unit: string; session: string; emulated: boolean; count: number; needed: number;
  set_aside?: { count: number; words: string; outliers: number; rows: { rows: number; reason: string; examples: string[] }[] };
  noise_floor: number;
  noise?: { degrees_of_freedom: number; lower: number; upper: number; from_repeats: boolean; is_rounding: boolean };
  initial: Quality; after_step: Quality[]; final: Quality; reducible_share: number;
  where: Slice[]; unexplained: Unexplained; candidates: Candidate[];
  set?: {
    rows: number; objects: string[]; poses: number; rounds: number; repeats: number; speeds_mm_s: number[];
    missed_contacts: number;
  };
  groups: Group[]; curves: Curve[]; fingers: string[]; finger_bias: number[];
  worst_touches: { touch: string; object: string; residual: number[]; norm: number }[];
  histograms: Histogram[]; outlines: { object: string; vertices_mm: number[]; triangles: number[] }[];
  photographs?: Photographs; distributions?: Distributions; touch_table?: TouchTable;
}

interface XYZ { x: number; y: number; z: number }

export interface Next {
  object: string; purpose: string; separation: number; count_to_verdict: number;
  touch?: { target_m: XYZ; approach: XYZ; lateral: XYZ; standoff_m: number; speed_m_s: number };
  photograph?: { eye_m: XYZ; at_m: XYZ; up: XYZ };
}

// One value of an effect that the model lacks; sizes in `unit`.
export interface Detectable {
  effect: string; parameter: string; unit: string; finger: string; stage: string; std_error: number; typical: number;
  power_at_typical: number; found_from?: number; rival: string; correlation: number; told_from?: number; parted_by: string;
}

export interface SessionValue {
  session: number; value: number; std_error: number; limit_lower: number; limit_upper: number; outside: boolean;
}

export interface ComparedValue {
  name: string; unit: string; finger: string; change: string; sessions: SessionValue[]; from_session: number; to_session: number;
  difference: number; std_error: number; lower: number; upper: number; between_sessions: number;
}

export interface ComparedEffect {
  effect: string; object: string; change: string; p: number; gain_nats: number; equivalent: string[]; values: ComparedValue[];
}

export interface SessionComparison {
  effects: ComparedEffect[]; model_yaml: string[]; words: string;
  same_poses: { from_session: number; to_session: number; poses: number; rms: number; expected: number; p: number; rms_after: number; p_after: number }[];
}

export interface Report {
  verdict: string; summary: string; warnings: string[]; model_name: string; model_hash: string;
  data_problems: {
    kind: string; detail: string; words: string; fix: string; error_before: number; error_after: number; data_index: number;
  }[];
  superfluous: string[]; refitted: { effect: string; parameters: Value[] }[]; steps: Step[]; data: DataReport[];
  improved_model_yaml: string; improved_model_hash: string; next: Next[]; version: string; duration_s: number;
  provenance?: {
    set_sha256: string; seed: string; command: string; date: string; client_version: string;
    meshes: { object: string; mesh_hash: string; path: string; file_sha256: string }[];
  };
  p_nothing_missing?: number; hypotheses_tried: number; detectable: Detectable[]; sessions?: SessionComparison;
}

export interface Rung {
  kind: "given" | "refit" | "step" | "suggestion" | "floor"; name: string; rmse: number | null; heldout_rmse: number | null;
  lack_of_fit_p: number | null;
}

export interface WordsOfData {
  kind_name: string; floor: number; floor_is_bound: boolean; times_the_floor: string; finger_bias: string; nearest_effect: string;
  uncertainty?: Record<string, number[]>; // x y z (mm) and standard uncertainty
  ladder?: Rung[]; // where several kinds of data were diagnosed together
}

export interface Words {
  headline: string; summary: string; data: string; floor: string; times_the_floor: string; nothing_missing: string;
  finger_scatter: string; ladder: Rung[]; command: string; commands: { purpose: string; command: string }[];
  problems: { title: string; fix: string }[]; ambiguities: { effects: string[]; to_decide: string }[];
  next: string[]; steps: string[]; to_tell: string[]; main?: number;
  of_data: WordsOfData[];
}

export interface PageData { report: Report; words: Words }
