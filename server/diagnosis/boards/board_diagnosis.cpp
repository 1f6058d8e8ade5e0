#include "server/diagnosis/boards/board_diagnosis.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numeric>

#include <absl/strings/str_format.h>
#include <absl/strings/str_join.h>

#include "server/base/distributions.h"
#include "server/base/random.h"
#include "server/base/status.h"
#include "server/base/text.h"
#include "server/diagnosis/boards/board_search.h"
#include "server/effects/all_effects.h"
#include "server/effects/photo_settings.h"

namespace touchstone::diagnosis::boards {
namespace {

constexpr int kResamples = 200;

// The parameters of the catalogue's effects by the lens's entries, and those of the rest by name.
struct EntryName {
  const char* parameter;
  const char* axis;
  const char* unit;
};
EntryName NameOf(int entry) {
  switch (entry) {
    case kFocal:
      return {"relative", "", ""};
    case kOffsetX:
      return {"offset_px", "x", "px"};
    case kOffsetY:
      return {"offset_px", "y", "px"};
    case kK1:
      return {"k1", "", ""};
    case kK2:
      return {"k2", "", ""};
    case kP1:
      return {"p1", "", ""};
    case kP2:
      return {"p2", "", ""};
    case kK3:
      return {"k3", "", ""};
    default:
      return {"aspect", "", ""};
  }
}

// `fullest`: the choice of all terms.
BoardQuality QualityOf(const BoardSet& set, const LensChoice& choice, const LensChoice& fullest) {
  const double corners = static_cast<double>(set.pictures.size()) * set.board.corners();
  return {std::sqrt(choice.fit.sum_px2 / corners), std::sqrt(SumOf(choice.unseen_px2) / corners),
          LackOfFitP(choice, fullest)};
}

LensChoice FitAllTerms(const BoardSet& set, const BoardFit& start) {
  std::vector<int> terms(LensTerms().size());
  std::iota(terms.begin(), terms.end(), 0);
  return FitChoice(set, start, terms);
}

// From the residuals of the lens with all terms: two readings a corner, less what was fitted.
BoardNoise NoiseOf(const BoardSet& set, const LensChoice& fullest) {
  BoardNoise noise;
  noise.degrees_of_freedom =
      static_cast<int>(set.pictures.size()) * (2 * set.board.corners() - 6) - kLensEntries;
  if (noise.degrees_of_freedom > 0)
    noise.sigma_px = std::sqrt(fullest.fit.sum_px2 / noise.degrees_of_freedom);
  return noise;
}

// Standard deviations of the lens over sets of as many pictures, drawn from the set's with replacement.
LensVector ResampledErrors(const BoardSet& set, const LensChoice& choice, uint64_t seed) {
  const uint64_t pictures = set.pictures.size();
  const std::vector<int> free = FreeEntries(choice.terms);
  LensVector sum = LensVector::Zero(), squares = LensVector::Zero();
  int count = 0;
  for (int draw = 0; draw < kResamples; ++draw) {
    RandomStream random(seed, RandomDomain::kDiagnosis, static_cast<uint64_t>(draw));
    std::vector<double> weights(pictures, 0.0);
    for (uint64_t i = 0; i < pictures; ++i) weights[random.Below(pictures)] += 1;
    // Fewer pictures than this need not determine a lens at all.
    if (std::count_if(weights.begin(), weights.end(), [](double w) { return w > 0; }) < 3) continue;
    const LensVector lens = FitBoards(set, choice.fit, free, weights).lens;
    sum += lens, squares += lens.cwiseProduct(lens), ++count;
  }
  const LensVector mean = sum / count;
  return ((squares / count - mean.cwiseProduct(mean)).cwiseMax(0) * count / (count - 1.0)).cwiseSqrt();
}

std::vector<engine::ParameterEstimate> Estimates(const LensTerm& term, const LensVector& lens,
                                                 const LensVector& errors, double t) {
  std::vector<engine::ParameterEstimate> estimates;
  for (const int entry : term.entries) {
    engine::ParameterEstimate estimate;
    const EntryName name = NameOf(entry);
    estimate.name = name.parameter;
    estimate.entry = name.axis;
    estimate.unit = name.unit;
    estimate.value = lens[entry];
    estimate.std_error = errors[entry];
    estimate.lower = lens[entry] - t * errors[entry];
    estimate.upper = lens[entry] + t * errors[entry];
    estimates.push_back(std::move(estimate));
  }
  return estimates;
}

// Of a term of the last choice among all that could take its place: none, or any term that is not there.
void Weigh(const BoardSet& set, const LensChoice& last, int term, BoardStep* step) {
  std::vector<int> others = last.terms;
  others.erase(std::find(others.begin(), others.end(), term));
  double rivals = std::exp(FitChoice(set, last.fit, others).log_evidence - last.log_evidence);
  for (int other = 0; other < static_cast<int>(LensTerms().size()); ++other) {
    if (std::find(last.terms.begin(), last.terms.end(), other) != last.terms.end()) continue;
    std::vector<int> swapped = others;
    swapped.push_back(other);
    const double less = last.log_evidence - FitChoice(set, last.fit, swapped).log_evidence;
    if (less < kMinGainNats && LensTerms()[other].named) step->equivalent.push_back(LensTerms()[other].name);
    rivals += std::exp(-less);
  }
  step->probability = std::min(engine::kMaxProbability, 1 / (1 + rivals));
}

// What no effect of the catalogue has and left-out pictures are predicted better with, one after the other.
std::vector<BoardRest> FindRest(const BoardSet& set, LensChoice now, const LensChoice& fullest) {
  std::vector<BoardRest> rest;
  for (;;) {
    std::optional<LensChoice> best;
    for (int term = 0; term < static_cast<int>(LensTerms().size()); ++term) {
      if (LensTerms()[term].named || std::find(now.terms.begin(), now.terms.end(), term) != now.terms.end())
        continue;
      std::vector<int> terms = now.terms;
      terms.push_back(term);
      LensChoice tried = FitChoice(set, now.fit, terms);
      if (!best.has_value() || tried.log_evidence > best->log_evidence) best = std::move(tried);
    }
    if (!best.has_value()) return rest;
    const double gain = best->log_evidence - now.log_evidence;
    if (gain < kMinGainNats || !PredictsBetter(*best, now)) return rest;
    const LensTerm& term = LensTerms()[best->terms.back()];
    BoardRest found;
    found.name = term.name;
    found.gain_nats = gain;
    found.quality = QualityOf(set, *best, fullest);
    for (const int entry : term.entries)
      found.values.emplace_back(NameOf(entry).parameter, best->fit.lens[entry]);
    rest.push_back(std::move(found));
    now = std::move(*best);
  }
}

// "k1=-0.2843,k2=0.05" as AddEffect takes it.
std::vector<std::string> Assignments(const BoardStep& step) {
  std::vector<std::string> assignments;
  for (const engine::ParameterEstimate& estimate : step.parameters) {
    const std::string value = ShortestNumber(estimate.value);
    if (estimate.entry == "y")
      assignments.back() += absl::StrCat(",", value);
    else
      assignments.push_back(absl::StrCat(estimate.name, "=", value));
  }
  return assignments;
}

absl::Status ImproveModel(const model::Model& model, BoardDiagnosis* diagnosis) {
  model::Model improved = model;
  for (const BoardStep& step : diagnosis->steps) {
    TOUCHSTONE_ASSIGN_OR_RETURN(
        improved, model::AddEffect(improved, step.effect, Assignments(step), effects::Catalogue()));
  }
  diagnosis->improved_model = std::move(improved);
  return absl::OkStatus();
}

std::string Summary(const BoardSet& set, const BoardDiagnosis& diagnosis) {
  const auto error = [](const BoardQuality& quality) {
    return absl::StrFormat("%.3f px (%.3f px on left-out pictures)", quality.rmse_px,
                           quality.heldout_rmse_px);
  };
  if (diagnosis.verdict == engine::Verdict::kTooLittleData)
    return absl::StrFormat(
        "The board was found in %d pictures; %d are needed, from different sides.%s", diagnosis.pictures,
        diagnosis.pictures_needed,
        diagnosis.pictures > 0
            ? ""
            : absl::StrFormat(" Is %dx%d the number of its inner corners, where four squares "
                              "meet, and is the whole board in the pictures?",
                              set.board.columns, set.board.rows));
  std::string words =
      absl::StrFormat("Reprojection error of %d corners in %d pictures: %s with the nominal lens%s.",
                      diagnosis.corners, diagnosis.pictures, error(*diagnosis.initial),
                      set.camera_is_guess ? ", which is a guess (no camera.yaml)" : "");
  for (const BoardStep& step : diagnosis.steps) {
    const auto value = [](const engine::ParameterEstimate& p) {
      return absl::StrFormat("%s%s%s %.5g +- %.2g", p.name, p.entry.empty() ? "" : " ", p.entry, p.value,
                             p.std_error);
    };
    absl::StrAppend(&words, " With ", step.effect, " (",
                    absl::StrJoin(step.parameters, ", ",
                                  [&](std::string* out, const auto& p) { absl::StrAppend(out, value(p)); }),
                    "): ", error(step.quality), ".");
  }
  if (diagnosis.steps.empty()) words += " No effect of the projection is missing.";
  for (const BoardRest& rest : diagnosis.rest) {
    const auto value = [](std::string* out, const std::pair<std::string, double>& v) {
      absl::StrAppendFormat(out, "%s %.4g", v.first, v.second);
    };
    absl::StrAppend(&words, " The catalogue has no effect for what is left: ", rest.name, " (",
                    absl::StrJoin(rest.values, ", ", value), ") would leave ", error(rest.quality), ".");
  }
  return words;
}

void AddSteps(const BoardSet& set, const LensSearch& search, const LensChoice& fullest, uint64_t seed,
              BoardDiagnosis* diagnosis) {
  const LensChoice& last = search.ladder.back();
  const LensVector errors = ResampledErrors(set, last, seed);
  const double t = StudentQuantile(0.975, static_cast<double>(set.pictures.size()) - 1);
  for (size_t k = 0; k < last.terms.size(); ++k) {
    const LensTerm& term = LensTerms()[last.terms[k]];
    BoardStep step;
    step.effect = term.name;
    step.gain_nats = search.gain_nats[k];
    step.parameters = Estimates(term, last.fit.lens, errors, t);
    step.quality = QualityOf(set, search.ladder[k + 1], fullest);
    Weigh(set, last, last.terms[k], &step);
    if (const auto effect = effects::Catalogue().Find(term.name)) {
      step.meaning = effect->meaning;
      step.check_on_rig = effect->check_on_rig;
      step.remedy = effect->remedy;
    }
    diagnosis->steps.push_back(std::move(step));
  }
}

}  // namespace

session::CameraIntrinsics LensOfModel(const session::CameraIntrinsics& nominal, const model::Model& model) {
  effects::PhotoSettings settings;
  for (const model::EffectInstance& instance : model.effects)
    if (instance.effect->stage == model::Stage::kProjection && instance.effect->apply_to_photo)
      instance.effect->apply_to_photo(instance.values, settings);
  session::CameraIntrinsics lens = nominal;
  lens.fx_px *= settings.focal_factor;
  lens.fy_px *= settings.focal_factor;
  lens.cx_px += settings.principal_point_offset_px.x();
  lens.cy_px += settings.principal_point_offset_px.y();
  lens.k1 += settings.k1;
  lens.k2 += settings.k2;
  return lens;
}

absl::StatusOr<BoardDiagnosis> DiagnoseBoards(const BoardSet& set, const model::Model& model, uint64_t seed) {
  const auto began = std::chrono::steady_clock::now();
  BoardDiagnosis diagnosis;
  diagnosis.model_name = model.name;
  diagnosis.model_hash = model.Hash();
  diagnosis.pictures = static_cast<int>(set.pictures.size());
  diagnosis.corners = diagnosis.pictures * set.board.corners();
  if (!set.without_board.empty())
    diagnosis.warnings.push_back(absl::StrCat("no whole board of ", set.board.columns, "x", set.board.rows,
                                              " inner corners was found in ",
                                              absl::StrJoin(set.without_board, ", ")));
  if (diagnosis.pictures < kMinBoardPictures) {
    diagnosis.verdict = engine::Verdict::kTooLittleData;
    diagnosis.pictures_needed = kMinBoardPictures;
    diagnosis.summary = Summary(set, diagnosis);
    return diagnosis;
  }
  BoardSet through_model = set;
  through_model.camera = LensOfModel(set.camera, model);
  TOUCHSTONE_ASSIGN_OR_RETURN(const BoardFit start, StartFit(through_model));
  const LensSearch search = SearchNamed(through_model, start);
  const LensChoice fullest = FitAllTerms(through_model, search.ladder.back().fit);
  diagnosis.initial = QualityOf(through_model, search.ladder.front(), fullest);
  diagnosis.final = QualityOf(through_model, search.ladder.back(), fullest);
  diagnosis.noise = NoiseOf(through_model, fullest);
  diagnosis.lens = search.ladder.back().fit.lens;
  AddSteps(through_model, search, fullest, seed, &diagnosis);
  diagnosis.rest = FindRest(through_model, search.ladder.back(), fullest);
  diagnosis.verdict = !diagnosis.rest.empty()    ? engine::Verdict::kUnexplained
                      : !diagnosis.steps.empty() ? engine::Verdict::kMissingEffects
                                                 : engine::Verdict::kAdequate;
  if (!diagnosis.steps.empty()) TOUCHSTONE_RETURN_IF_ERROR(ImproveModel(model, &diagnosis));
  diagnosis.summary = Summary(set, diagnosis);
  diagnosis.duration_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
  return diagnosis;
}

}  // namespace touchstone::diagnosis::boards
