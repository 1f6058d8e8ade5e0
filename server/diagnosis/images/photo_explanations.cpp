#include "server/diagnosis/images/photo_explanations.h"

#include "server/diagnosis/images/photo_search.h"

namespace touchstone::diagnosis::images {
namespace {

constexpr size_t kMaxExplanations = 4;

// The nameless image field is no effect of a model file: both sides have it, and it tells nothing apart.
std::shared_ptr<const model::Model> WithoutField(model::Model model, const PhotoSelection& selection) {
  if (selection.field >= 0) {
    const std::string& name = selection.fit.model.base().effects[selection.field].effect->name;
    for (size_t e = model.effects.size(); e-- > 0;)
      if (model.effects[e].effect->name == name)
        model.effects.erase(model.effects.begin() + static_cast<int>(e));
  }
  return std::make_shared<const model::Model>(std::move(model));
}

}  // namespace

ExplanationsLeft FindExplanationsLeft(const PhotoSelection& selection) {
  ExplanationsLeft left;
  left.noise = selection.photographs->noise;
  const selection::SelectedStep* closest = nullptr;
  for (const selection::SelectedStep& step : selection.steps)
    if (!step.competing.empty() && (closest == nullptr || step.competing[0].relative_log_evidence >
                                                              closest->competing[0].relative_log_evidence))
      closest = &step;
  const model::Model& best = selection.fit.model.base();
  if (closest == nullptr) {
    left.models.push_back({"the model as it is", WithoutField(best, selection)});
    return left;
  }
  left.models.push_back(
      {inference::NameOf(*best.effects[closest->effect].effect), WithoutField(best, selection)});
  for (const selection::CompetingEffect& other : closest->competing) {
    left.confounded |= other.equivalent;
    if (!other.equivalent && left.models.size() > 1) break;
    if (left.models.size() == kMaxExplanations) break;
    left.models.push_back({other.name, WithoutField(other.model, selection)});
  }
  return left;
}

}  // namespace touchstone::diagnosis::images
