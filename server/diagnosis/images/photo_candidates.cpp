#include "server/diagnosis/images/photo_candidates.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <tuple>

#include "server/base/status.h"
#include "server/diagnosis/images/image_field.h"
#include "server/diagnosis/inference/held_out.h"
#include "server/diagnosis/inference/laplace_evidence.h"

namespace touchstone::diagnosis::images {
namespace {

constexpr int kMaxFittedAlone = 8;       // candidates that are fitted in full
constexpr int kMaxFittedAloneOnOne = 3;  // ... of those that do not act on all objects alike

// Whether every value of the effect ended where it changes nothing.
bool StayedNeutral(const inference::Fit& fit, int index) {
  for (int i = 0; i < fit.model.size(); ++i) {
    const inference::FreeParameter& c = fit.model.parameters()[i];
    if (c.effect == index && std::abs(fit.point[i] - c.neutral) > 1e-9 * c.scale) return false;
  }
  return true;
}

class PhotoCandidateRanking {
 public:
  PhotoCandidateRanking(const Photographs& photographs, const PhotoSelection& selection, double floor_grey,
                        ThreadPool* pool)
      : photographs_(photographs), selection_(selection), floor_grey_(floor_grey), pool_(pool) {}

  absl::StatusOr<std::vector<RankedPhotographCandidate>> Run() {
    const selection::StepwiseSearch& search = *selection_.fine.search;
    TOUCHSTONE_ASSIGN_OR_RETURN(std::vector<selection::Extension> extensions,
                                search.Score(selection_.initial, selection_.initial_effects));
    std::stable_sort(extensions.begin(), extensions.end(),
                     [](const auto& a, const auto& b) { return a.log_evidence > b.log_evidence; });
    // The most probable place to start from stands for an effect.
    std::set<std::tuple<std::string, bool, std::string>> listed;
    for (const selection::Extension& extension : extensions) {
      if (extension.candidate < 0) continue;
      const bool per_object = search.candidates()[extension.candidate].per_object;
      if (!listed.insert({extension.name, per_object, extension.object}).second) continue;
      TOUCHSTONE_RETURN_IF_ERROR(Add(extension, per_object));
    }
    for (RankedPhotographCandidate& candidate : ranked_)
      if (Explains(candidate))
        candidate.probability = selection::ProbabilityOfShare(candidate.gain_nats - inference::LogSum(all_));
    std::stable_sort(ranked_.begin(), ranked_.end(), [](const auto& a, const auto& b) {
      return Explains(a) != Explains(b) ? Explains(a) : a.gain_nats > b.gain_nats;
    });
    return std::move(ranked_);
  }

 private:
  static bool Explains(const RankedPhotographCandidate& candidate) {
    return candidate.note != selection::CandidateNote::kInvisible &&
           candidate.note != selection::CandidateNote::kNeutral;
  }

  absl::Status Add(const selection::Extension& extension, bool per_object) {
    const double gain_nats = extension.log_evidence - selection_.initial.log_evidence;
    if (extension.name == kImageFieldName) {
      if (extension.visible) all_.push_back(gain_nats);
      return absl::OkStatus();
    }
    if (extension.rare && (fitted_on_one_ == kMaxFittedAloneOnOne || !extension.visible))
      return absl::OkStatus();
    RankedPhotographCandidate& candidate = ranked_.emplace_back();
    candidate.effect = extension.name;
    candidate.scope = per_object ? selection::EffectScope::kObject : selection::EffectScope::kRig;
    if (!extension.visible) {
      candidate.note = selection::CandidateNote::kInvisible;
      return absl::OkStatus();
    }
    candidate.gain_nats = gain_nats;
    if (extension.rare || fitted_ < kMaxFittedAlone) {
      ++(extension.rare ? fitted_on_one_ : fitted_);
      TOUCHSTONE_RETURN_IF_ERROR(FitAlone(extension, &candidate));
    } else {
      candidate.note = selection::CandidateNote::kLinearised;
    }
    if (Explains(candidate)) all_.push_back(candidate.gain_nats);
    return absl::OkStatus();
  }

  absl::Status FitAlone(const selection::Extension& extension, RankedPhotographCandidate* candidate) {
    TOUCHSTONE_ASSIGN_OR_RETURN(const inference::Fit fit, selection_.fine.search->FitExtension(extension));
    candidate->gain_nats = fit.log_evidence - selection_.initial.log_evidence;
    const int index = static_cast<int>(fit.model.base().effects.size()) - 1;
    if (StayedNeutral(fit, index)) {
      candidate->gain_nats = 0;
      candidate->note = selection::CandidateNote::kNeutral;
      return absl::OkStatus();
    }
    if (selection::IsAtBound(fit, index)) candidate->note = selection::CandidateNote::kAtBound;
    candidate->parameters = fit.model.Describe(index, fit.point, fit.covariance);
    TOUCHSTONE_ASSIGN_OR_RETURN(const std::vector<image::Photo> expected,
                                ExpectPhotographs(photographs_, fit.model.base(), false, pool_));
    candidate->rmse_grey = RmseGrey(photographs_, expected);
    candidate->heldout_rmse_grey = std::sqrt(candidate->rmse_grey * candidate->rmse_grey + UnseenExcess(fit));
    return absl::OkStatus();
  }

  // What pictures that a fit did not see have beyond those that it saw, as mean square grey levels; the fits to others
  // are linear steps, since these are many.
  double UnseenExcess(const inference::Fit& fit) const {
    const PhotoRows& rows = *selection_.fine.rows;
    const double seen = fit.columns.values.col(0).squaredNorm();
    const double unseen = std::max(inference::HeldOutRmse(*selection_.fine.experiment, fit),
                                   inference::HeldOutRmseByBlock(*selection_.fine.experiment, fit));
    const double pixels =
        static_cast<double>(photographs_.width()) * photographs_.height() * rows.photographs();
    return std::max(rows.rows() * unseen * unseen - seen, 0.0) * floor_grey_ * floor_grey_ / pixels;
  }

  const Photographs& photographs_;
  const PhotoSelection& selection_;
  const double floor_grey_;
  ThreadPool* pool_;
  std::vector<RankedPhotographCandidate> ranked_;
  std::vector<double> all_ = {0};  // log evidence: nothing is missing
  int fitted_ = 0, fitted_on_one_ = 0;
};

}  // namespace

absl::StatusOr<std::vector<RankedPhotographCandidate>> RankPhotoCandidates(const Photographs& photographs,
                                                                           const PhotoSelection& selection,
                                                                           double floor_grey,
                                                                           ThreadPool* pool) {
  return PhotoCandidateRanking(photographs, selection, floor_grey, pool).Run();
}

}  // namespace touchstone::diagnosis::images
