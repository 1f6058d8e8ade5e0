// All that a diagnosis says, whatever was measured, as plain values: errors, residuals and noise of an entry in the unit of
// its kind, parameters in the units of files, the rest in SI. from_*.h make it of what each kind's engine found,
// write_report.h turns it into the wire message, summary.h into sentences.
#pragma once

#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "server/diagnosis/boards/board_diagnosis.h"
#include "server/diagnosis/design/propose.h"
#include "server/diagnosis/distributions/pose_free.h"
#include "server/diagnosis/engine/competition/detectability.h"
#include "server/diagnosis/engine/competition/effect_explanation.h"
#include "server/diagnosis/engine/ladder/ladder.h"
#include "server/diagnosis/engine/nothing_missing.h"
#include "server/diagnosis/images/photograph_diagnosis.h"
#include "server/diagnosis/joint/session_changes.h"
#include "server/diagnosis/residuals/slices/model_comparison.h"
#include "server/diagnosis/residuals/touches/describe_residuals.h"
#include "server/diagnosis/touches/data_summary.h"
#include "server/diagnosis/touches/same_poses.h"
#include "server/session/measurements/backward_times.h"
#include "server/uncertainty/budget.h"
#include "server/uncertainty/posterior.h"

namespace touchstone::diagnosis::report {

// In the order of v1::DataReport::Kind.
enum class DataKind { kTouches, kPhotographs, kBoards, kDistributions };

// "us", "grey" or "px".
const char* UnitOf(DataKind kind);

// The engine's, with errors and noise in the unit of the entry.
using engine::NoiseFloor;
using engine::Quality;
using Candidate = engine::RankedCandidate;
using Unexplained = engine::UnexplainedRest;

// An effect to add. Its errors: DataReport::after_step.
struct Step : engine::LadderStep {
  std::vector<DataKind> shown_by;  // of a joint diagnosis
};

struct DataProblem : engine::DataProblem {
  int data_index = 0;  // its errors are in the unit of data[data_index]
};

// A part of the data in which the model is wrong.
struct Slice {
  std::string conditions, words;  // "incidence > 12 deg and finger = r", "contact too early by 9.1 ms"
  int count = 0;                  // touches or pictures with such a part
  double mean_residual = 0, rmse = 0, share_of_excess_error = 0;
};

struct Group {
  residuals::ErrorGroupKind kind = residuals::ErrorGroupKind::kObject;
  std::string name;
  int count = 0;
  double rmse = 0, mean_residual = 0, share_of_excess_error = 0;
};

// The residual against one covariate.
struct Curve {
  struct Bin {
    std::string finger;  // empty: of all
    double centre = 0, mean_residual = 0, std_error = 0, after = 0;
    int64_t count = 0;  // touches or pixels
  };
  struct OfFinger {
    std::string finger;
    double p = 1, p_after = 1;
  };
  std::string covariate, unit;  // the covariate's
  std::vector<Bin> bins;
  double p = 1, p_after = 1;
  std::vector<OfFinger> fingers;
};

// The outlines and single pictures of photographs.
struct PhotographDescription {
  double silhouette_iou = 1, silhouette_iou_after = 1;
  double contour_distance_px = 0, contour_distance_after_px = 0;
  std::vector<images::PhotographError> photographs;
  std::vector<images::PhotographMap> maps;
  bool coloured = false;  // compared as the mean of three channels
};

// Measurements that took no part.
struct SetAside {
  struct Rows {
    std::string reason;
    int count = 0;
    std::vector<uint64_t> examples;  // touch numbers
  };
  std::vector<Rows> rows;
  int outliers = 0;    // among them: those that a comparison counts and the search did not
  std::string judged;  // a sentence of what outliers share, with a full stop; empty: there are none

  int count() const;
};

// A second model on the same touches; the difference is in seconds, as residuals/ has it.
struct Versus {
  std::string other_name, other_hash;
  Quality other;
  residuals::ModelDifference difference;
  std::string words;
};

// Why one effect is, or is not, what is missing; touches in seconds.
struct ReportedExplanation {
  engine::EffectExplanation found;
  Quality quality;
  std::vector<residuals::DecidingTouch> speak_for, speak_against;
  std::string words;
};

// What one kind of measurement says.
struct DataReport {
  DataKind kind = DataKind::kTouches;
  std::string session;         // the path, or the session's name
  std::string content_sha256;  // of what was measured, whatever file it stood in; empty: unknown
  int emulated = 0;            // rows that an emulator made: they measure nothing
  int count = 0;               // touches or pictures that took part
  SetAside set_aside;
  int needed = 0;  // with kTooLittleData; 0: this kind has enough

  // How wrong; none of them if nothing could be used.
  std::optional<NoiseFloor> noise_floor;
  std::optional<Quality> initial;   // the model as it was given
  std::vector<Quality> after_step;  // one per step of the diagnosis
  std::optional<Quality> final;     // after all steps and refits
  double reducible_share = 0;       // of the mean square error that is not noise, 0 to 1

  std::optional<Versus> versus;

  std::vector<Slice> where;
  std::optional<Unexplained> unexplained;
  std::vector<Candidate> candidates;

  // What the set consists of.
  int rows = 0, poses = 0, repeats = 0, rounds = 0, missed_contacts = 0;
  session::BackwardTimes backward_times;  // of touches
  std::vector<std::string> objects;
  std::vector<double> speeds_mm_s;

  std::vector<Group> groups;
  std::vector<Curve> curves;

  // Of touches, in seconds as residuals/ has them; slices, groups and curves stand above.
  std::vector<std::string> fingers;
  std::vector<double> finger_bias_s;
  std::optional<residuals::FingerScatter> finger_scatter;
  std::vector<residuals::WorstTouch> worst_touches;
  std::vector<residuals::ComparedHistogram> histograms;
  std::vector<residuals::ParityPoint> parity;
  std::vector<residuals::SurfaceResidual> surface_points;
  std::vector<residuals::DrawableObject> outlines;
  residuals::TouchTable table;

  std::optional<PhotographDescription> photographs;
  std::optional<distributions::PoseFreeComparison> distributions;
  std::optional<boards::BoardLens> lens;
};

// Several sessions of touches with one model; sessions are places in Diagnosis::data.
struct Sessions {
  struct Pair {
    int from = 0, to = 0;
    touches::SamePoses measured, left;  // under the given model, and under each session's own
  };
  int count = 0;                                 // of all sessions
  std::vector<int> taking_part;                  // sessions with enough touches; those of `changes`, in order
  std::optional<joint::SessionChanges> changes;  // none: a comparison, or fewer than two take part
  std::vector<Pair> same_poses;
  std::string words;
};

using NextMeasurement = std::variant<design::ProposedTouch, images::ProposedPhotograph>;

struct Diagnosis {
  engine::Verdict verdict = engine::Verdict::kNone;
  std::string model_name, model_hash;  // of the initial model
  std::vector<DataReport> data;        // one per kind and session

  std::vector<engine::RefittedEffect> refitted;
  std::vector<Step> steps;
  std::vector<engine::ConfoundedEffects> confounded;
  std::vector<std::string> superfluous;        // effects of the model that the data do without
  std::vector<DataProblem> data_problems;      // with kCheckData; no step is claimed beside them
  std::optional<model::Model> improved_model;  // none: nothing changed
  // See v1::Report.
  std::optional<double> p_nothing_missing;
  int hypotheses_tried = 0;
  std::vector<NextMeasurement> next;
  // What touches like these could have shown.
  std::vector<engine::DetectableValue> detectable;
  std::optional<ReportedExplanation> explained;
  std::optional<Sessions> sessions;
  // Of the model that the report ends with, and how well it predicts touches like these.
  std::optional<uncertainty::Posterior> posterior;
  std::vector<uncertainty::Budget> uncertainty;  // in the unit of data[0]

  std::string summary;                // one paragraph
  std::vector<std::string> warnings;  // what limits all this
  double duration_s = 0;
};

// None: not assessed.
void SetNothingMissing(const std::optional<engine::NothingMissing>& found, Diagnosis* diagnosis);

// Verdict, steps and all else that every kind of measurement is told of, in the unit of data[0].
void AddImprovement(const engine::Improvement& improvement, Diagnosis* diagnosis);

// Pictures that say nothing new: their files among data[0]'s rows that are set aside, and a warning.
void SetCopiesAside(const std::vector<std::string>& files, Diagnosis* diagnosis);

// The share of a squared error that is the model's, not noise: 0 to 1.
double ReducibleShare(const NoiseFloor& floor, double rmse);

}  // namespace touchstone::diagnosis::report
