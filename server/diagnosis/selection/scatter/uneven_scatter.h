// Whether the scatter of the times differs between parts of a set: one object, one stretch of the session, one round, one
// speed, far and near, touches from above and from below; of all fingers or of one. Parts that scatter differently make the tails of the whole look
// heavy, and are no noise of the catalogue.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "server/diagnosis/engine/competition/result.h"
#include "server/diagnosis/touches/noise/noise_kinds.h"
#include "server/diagnosis/touches/observations.h"
#include "server/diagnosis/touches/prediction.h"

namespace touchstone::diagnosis::selection {

struct UnevenScatter {
  struct Part {
    std::string name;  // "lat10", "the first quarter of the session"
    double scale_s = 0;
    int touches = 0;
  };
  int finger = -1;  // whose scatter it is; -1: of all
  std::vector<Part> parts;
  engine::CovariateTest
      test;  // the covariate, its p-value over all that were tried, the gain over one scatter (BIC)
  // Of covariates that part the touches so alike that they say nearly the same.
  std::vector<engine::CovariateTest> alike;
  bool tails_remain = false;  // the tails are heavy within the parts too
  std::string words;          // sentences for people
};

// `sample`: of the residuals of the best model, with `details` of it; `noise`: found in the same residuals; what of the
// scatter it explains (growth, fingers, lengths) is no difference between parts. Where there are repeats they are asked,
// which no misfit touches. Nothing where one scatter says the same, or the scales differ by less than a third.
std::optional<UnevenScatter> FindUnevenScatter(const touches::Observations& observations,
                                               const touches::Prediction& details,
                                               const touches::NoiseSample& sample,
                                               const touches::NoiseFindings& noise);

// Puts its covariates among those of the rest: in front, unless the means have a `rest` too.
void NameUnevenScatter(const UnevenScatter& scatter, bool rest_of_means, engine::UnexplainedRest* rest);

}  // namespace touchstone::diagnosis::selection
