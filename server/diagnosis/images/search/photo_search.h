// The search for what photographs lack, first in coarse cells, which see displacements of many pixels, then in fine ones.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "server/diagnosis/engine/competition/competition.h"
#include "server/diagnosis/engine/fit/fit.h"
#include "server/diagnosis/engine/nothing_missing.h"
#include "server/diagnosis/images/photo_hypotheses.h"
#include "server/diagnosis/images/rows/photo_rows.h"
#include "server/diagnosis/input.h"

namespace touchstone::diagnosis::images {

// What one search works on. The parts point to one another.
struct PhotoSearch {
  std::unique_ptr<PhotoRows> rows;
  std::unique_ptr<engine::Likelihood> likelihood;
  std::unique_ptr<engine::Likelihood>
      plain;  // without a smooth error of the albedo, where the experiment has none
  std::unique_ptr<engine::Experiment> experiment;
  std::unique_ptr<engine::StepwiseSearch> search;
};

// Effects of photographs, those of touches that move the surface, and the nameless image field, as far as the model
// lacks them; and the user's own.
std::vector<engine::Candidate> PhotoCandidates(const DiagnosisInput& input, const Photographs& photographs);

// Effects with a name that act on every object alike.
std::vector<engine::Candidate> NamedOfRig(const std::vector<engine::Candidate>& candidates);

absl::StatusOr<PhotoSearch> MakePhotoSearch(const Photographs& photographs, const model::Model& anchor,
                                            const std::vector<engine::Candidate>& candidates,
                                            const PhotoRowsOptions& options, const DiagnosisContext& context);

// A fit on the way to the whole explanation: with this effect and those of all rungs before it.
struct PhotoRung {
  int effect = 0;   // index in the explanation's model
  engine::Fit fit;  // of the last rung: the polished one, without what is nameless
  double rmse = 0;  // grey levels, of all photographs
  double heldout_ratio = 1;
};

struct PhotoSelection {
  // The same photographs, with the noise of what the coarse search leaves: what the fine one and its fits work on.
  std::unique_ptr<Photographs> photographs;
  PhotoSearch fine;
  engine::Fit initial;  // the given model, in fine rows
  engine::Fit fit;      // the explanation; the image field among its effects where it takes part
  // The explanation fitted to every photograph, contours trusted as what the explanation leaves shows: what its values
  // are taken from.
  engine::Fit polished;
  engine::Hypotheses found{PhotoHypothesisRules()};
  int initial_effects = 0;
  int field = -1;                           // index of the image field's effect; -1: none
  std::vector<PhotoRung> rungs;             // of the ladder, in the order in which they explain most
  std::vector<engine::SelectedStep> steps;  // named effects
  Eigen::MatrixXd covariance;  // of the polished fit's free parameters, as its scatter between pictures shows
  // Of the fit, the error on photographs that it did not see over that on those it saw; at least 1.
  double heldout_ratio = 1;
  double albedo_nats = 0;      // evidence of a smooth error of the albedo over none
  engine::TriedPValues tried;  // of the given model; empty: too few pictures
};

absl::StatusOr<PhotoSelection> SelectPhotoExplanation(const DiagnosisInput& input,
                                                      const Photographs& photographs,
                                                      const DiagnosisContext& context);

// Rows of every photograph near a fit, contours trusted as what it leaves shows; no candidates. Without a smooth error of
// the albedo where the fit has none. The parts point to one another.
struct PolishRows {
  PhotoSearch search;
  std::unique_ptr<engine::Likelihood> plain;
  engine::Experiment experiment;
};
absl::StatusOr<PolishRows> MakePolishRows(const Photographs& photographs, const engine::Fit& fit,
                                          const DiagnosisContext& context);

// Fits the explanation to every photograph: `polished` and `covariance`.
absl::Status PolishExplanation(const Photographs& photographs, const DiagnosisContext& context,
                               PhotoSelection* selection);

// Adds effects that each take three fifths or more of the excess error from pictures that they were not fitted to, where the
// explanation leaves a clear misfit: a smooth error of the albedo and of the picture, which take the place of such an effect
// and of what lies beside it, take no part from then on.
absl::Status AddLargeSteps(const Photographs& photographs, const DiagnosisContext& context,
                           PhotoSelection* selection);

// A field that is small against the noise is what simulation and noise are known to, not dirt: it goes.
absl::Status DropFaintField(PhotoSelection* selection);

// Steps go whose values the scatter between pictures could make go.
absl::Status DropUnsteady(PhotoSelection* selection);

// Choices (ParameterInfo::choices), between which fits move freely, become what they are nearest to, and are no longer free;
// an effect whose value is none of them goes.
absl::Status HoldChoices(PhotoSelection* selection);

// Polishes the explanation, and takes out every step with which the error, of all pictures or of those that its fit did
// not see, does not fall: `polished`, `covariance`, `rungs`.
absl::Status KeepStepsWithGain(const Photographs& photographs, const DiagnosisContext& context,
                               PhotoSelection* selection);

// What a fit leaves of the rows of its search.
struct RowsMisfit {
  double in_noise = 0;  // root mean square
  double p = 1;         // that noise leaves so much,
  double p_counts = 1;  // ... and that noise PhotoSearchRules::misfit_rows times as large does
};
RowsMisfit MisfitOfRows(const PhotoSearch& search, const engine::Fit& fit);

// The covariance of the free parameters that the scatter between blocks shows, or of each value the fit's, where
// that is larger.
Eigen::MatrixXd CovarianceBetweenBlocks(const engine::Experiment& experiment, const engine::Fit& fit);

}  // namespace touchstone::diagnosis::images
