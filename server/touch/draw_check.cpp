#include "server/touch/draw_check.h"

#include <absl/strings/str_cat.h>

#include <cmath>
#include <numeric>

#include "server/base/text/text.h"
#include "server/base/units.h"

namespace touchstone::touch {

uint64_t DrawCounts::Draws() const {
  return std::accumulate(by_flaw.begin(), by_flaw.end(), uint64_t{0});
}

std::string DrawCounts::FlawsInWords(const Plan& plan) const {
  const double incidence_deg =
      FromSi(Unit::kDegree,
             plan.kind == Plan::Kind::kFaces ? plan.faces.max_incidence_rad : plan.sphere.max_incidence_rad);
  const double stroke_mm = FromSi(Unit::kMillimetre, plan.faces.stroke_beyond_target_m);
  const std::string words[kDrawFlaws] = {
      "",
      "the line met no surface",
      "a finger started inside of the object or behind a part of it",
      "a finger met nothing",
      absl::StrCat("a finger met the object more than ", ShortestNumber(stroke_mm), " mm behind the target"),
      absl::StrCat("a finger met the surface at an incidence of more than ",
                   ShortestNumber(std::round(incidence_deg * 1e6) / 1e6), " deg")};
  std::string text;
  for (int flaw = 1; flaw < kDrawFlaws; ++flaw)
    if (by_flaw[flaw] > 0)
      absl::StrAppend(&text, text.empty() ? "in " : ", in ", by_flaw[flaw], " ", words[flaw]);
  return text;
}

DrawCheck::DrawCheck(const Plan& plan) : plan_(plan) {
  const double max_incidence_rad = plan.kind == Plan::Kind::kFaces    ? plan.faces.max_incidence_rad
                                   : plan.kind == Plan::Kind::kSphere ? plan.sphere.max_incidence_rad
                                                                      : kPi / 2;
  // A right angle and more is no limit, to rounding.
  constexpr double kAnyIncidence = 1e-9;
  const double cosine = std::cos(max_incidence_rad);
  if (cosine > kAnyIncidence) min_cos_incidence_ = cosine;
}

void DrawCheck::Check(const effects::TouchBatch& batch, absl::Span<const TouchPose> poses,
                      Workspace* workspace, std::vector<DrawFlaw>* flaws) const {
  const int size = batch.size();
  flaws->assign(size, DrawFlaw::kNone);
  if (plan_.kind == Plan::Kind::kList) return;
  const bool faces = plan_.kind == Plan::Kind::kFaces;
  if (faces) {
    for (int touch = 0; touch < size; ++touch)
      if (!poses[touch].meets_surface) (*flaws)[touch] = DrawFlaw::kNoSurface;
    CheckStarts(batch, workspace, flaws);
  }
  // Worse flaws first: later ones do not overwrite them.
  const auto mark = [&](int touch, bool flawed, DrawFlaw flaw) {
    DrawFlaw& present = (*flaws)[touch];
    if (flawed && present == DrawFlaw::kNone) present = flaw;
  };
  for (int finger = 0; finger < batch.fingers(); ++finger)
    for (int touch = 0; touch < size; ++touch)
      mark(touch, std::isnan(batch.travel_m[batch.At(finger, touch)]), DrawFlaw::kFingerMissed);
  for (int finger = 0; faces && finger < batch.fingers(); ++finger)
    for (int touch = 0; touch < size; ++touch)
      mark(touch,
           batch.travel_m[batch.At(finger, touch)] >
               poses[touch].standoff_m + plan_.faces.stroke_beyond_target_m,
           DrawFlaw::kBeyondStroke);
  for (int finger = 0; min_cos_incidence_ > 0 && finger < batch.fingers(); ++finger)
    for (int touch = 0; touch < size; ++touch)
      mark(touch, batch.cos_incidence[batch.At(finger, touch)] < min_cos_incidence_,
           DrawFlaw::kSteepIncidence);
}

// A hand that comes in along the approach gets to its start only if nothing of the object stands behind any finger.
void DrawCheck::CheckStarts(const effects::TouchBatch& batch, Workspace* workspace,
                            std::vector<DrawFlaw>* flaws) const {
  const size_t count = static_cast<size_t>(batch.size()) * batch.fingers();
  workspace->origins_m.resize(count);
  workspace->directions.resize(count);
  for (int finger = 0; finger < batch.fingers(); ++finger) {
    const double x_m = batch.FingerPosition(finger) * batch.spacing_m;
    for (int touch = 0; touch < batch.size(); ++touch) {
      const int k = batch.At(finger, touch);
      workspace->origins_m[k] = batch.target_m[touch] - batch.approach[touch] * batch.standoff_m[touch] +
                                batch.lateral[touch] * x_m;
      workspace->directions[k] = -batch.approach[touch];
    }
  }
  batch.surface->CastLines(workspace->origins_m, workspace->directions, kNoStrokeLimitM,
                           &workspace->contacts);
  for (int finger = 0; finger < batch.fingers(); ++finger)
    for (int touch = 0; touch < batch.size(); ++touch)
      if ((*flaws)[touch] == DrawFlaw::kNone &&
          !std::isnan(workspace->contacts.travel_m[batch.At(finger, touch)]))
        (*flaws)[touch] = DrawFlaw::kStartBlocked;
}

}  // namespace touchstone::touch
