#include "server/diagnosis/images/photo_explanations.h"

#include "server/diagnosis/images/pixels/image_field.h"
#include "server/diagnosis/images/search/photo_search.h"

namespace touchstone::diagnosis::images {

ExplanationsLeft FindExplanationsLeft(const PhotoSelection& selection) {
  ExplanationsLeft left = {
      engine::FindExplanationsLeft(selection.fit, selection.steps, selection.fit.model.base()),
      selection.photographs->noise};
  for (auto& [name, model] : left.models)
    model = std::make_shared<const model::Model>(WithoutImageField(*model));
  return left;
}

}  // namespace touchstone::diagnosis::images
