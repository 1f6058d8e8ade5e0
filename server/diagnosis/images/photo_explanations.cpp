#include "server/diagnosis/images/photo_explanations.h"

#include "server/diagnosis/images/pixels/image_field.h"
#include "server/diagnosis/images/search/photo_search.h"

namespace touchstone::diagnosis::images {

ExplanationsLeft FindExplanationsLeft(const PhotoSelection& selection) {
  ExplanationsLeft left = {
      engine::FindExplanationsLeft(selection.fit, selection.steps, selection.fit.model.base()),
      selection.photographs->noise};
  for (auto& [name, model] : left.models) {
    model::Model without = *model;
    for (size_t e = without.effects.size(); e-- > 0;)
      if (without.effects[e].effect->name == kImageFieldName)
        without.effects.erase(without.effects.begin() + static_cast<long>(e));
    model = std::make_shared<const model::Model>(std::move(without));
  }
  return left;
}

}  // namespace touchstone::diagnosis::images
