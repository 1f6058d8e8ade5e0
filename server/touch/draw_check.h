// The one rule for a drawn touch: whether it is one of its plan, or is drawn again, and why.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include <absl/types/span.h>

#include "server/effects/touch_batch.h"
#include "server/touch/plan.h"
#include "server/touch/simulate.h"

namespace touchstone::touch {

// Why a draw is rejected: the first of these that holds.
enum class DrawFlaw : uint8_t {
  kNone,           // it is a touch of the plan
  kNoSurface,      // faces: nothing stands on the line on which the target was to lie
  kStartBlocked,   // faces: a finger starts inside of the object or behind a part of it
  kFingerMissed,   // a finger meets nothing
  kBeyondStroke,   // faces: a finger meets the object only beyond the end of the stroke
  kSteepIncidence  // a finger meets the surface at more than the plan's largest incidence
};
inline constexpr int kDrawFlaws = 6;

// How often each came out.
struct DrawCounts {
  std::array<uint64_t, kDrawFlaws> by_flaw{};  // indexed by DrawFlaw; [kNone] counts the touches

  void Add(DrawFlaw flaw) { ++by_flaw[static_cast<int>(flaw)]; }
  uint64_t Of(DrawFlaw flaw) const { return by_flaw[static_cast<int>(flaw)]; }
  uint64_t Draws() const;
  // "in 970 a finger met nothing, in 30 a finger met the surface at more than 60 deg"; empty without flaws.
  std::string FlawsInWords(const Plan& plan) const;
};

class DrawCheck {
 public:
  // `plan` must outlive the check. An explicit list's touches are never drawn again, so none has a flaw.
  explicit DrawCheck(const Plan& plan);

  // Work space of one thread.
  struct Workspace {
    std::vector<Eigen::Vector3d> origins_m, directions;
    geometry::Contacts contacts;
  };

  // Whether touch t of a batch that went through TouchSimulator::RunToMotion is a touch of the plan: flaws[t].
  // `poses` as they were drawn, one per touch. The model of the simulation decides where the fingers really are.
  void Check(const effects::TouchBatch& batch, absl::Span<const TouchPose> poses, Workspace* workspace,
             std::vector<DrawFlaw>* flaws) const;

 private:
  void CheckStarts(const effects::TouchBatch& batch, Workspace* workspace,
                   std::vector<DrawFlaw>* flaws) const;

  const Plan& plan_;
  double min_cos_incidence_ = 0;  // 0: any incidence
};

}  // namespace touchstone::touch
