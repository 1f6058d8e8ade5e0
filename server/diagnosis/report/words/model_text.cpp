#include "server/diagnosis/report/words/model_text.h"

#include <optional>
#include <vector>

#include "server/model/model.h"
#include "server/model/provenance.h"

namespace touchstone::diagnosis::report {
namespace {

// `rmse_after` by part of the data; none: unknown.
std::string TextWith(const Diagnosis& diagnosis, const model::Model& model,
                     const std::vector<std::optional<double>>& rmse_after) {
  model::Provenance provenance;
  provenance.over_name = diagnosis.model_name;
  provenance.over_hash = diagnosis.model_hash;
  for (size_t i = 0; i < diagnosis.data.size(); ++i) {
    const DataReport& data = diagnosis.data[i];
    if (data.count == 0 || data.needed > 0) continue;  // nothing was fitted to it
    model::UsedSet& set = provenance.fitted_to.emplace_back();
    set.set = data.session;
    set.sha256 = data.content_sha256;
    if (!data.initial || !(data.initial->rmse > 0) || !rmse_after[i]) continue;
    set.unit = UnitOf(data.kind);
    set.rmse_before = data.initial->rmse;
    set.rmse_after = *rmse_after[i];
  }
  return model::FormatModel(model) + model::FormatProvenance(provenance);
}

}  // namespace

std::string ImprovedModelText(const Diagnosis& diagnosis, const model::Model& model) {
  std::vector<std::optional<double>> after;
  for (const DataReport& data : diagnosis.data)
    after.push_back(data.final ? std::optional(data.final->rmse) : std::nullopt);
  return TextWith(diagnosis, model, after);
}

std::string SuggestedModelText(const Diagnosis& diagnosis, int place) {
  std::vector<std::optional<double>> after(diagnosis.data.size());
  const Unexplained& rest = *diagnosis.data[place].unexplained;
  if (rest.rmse > 0) after[place] = rest.rmse;
  return TextWith(diagnosis, *rest.model_with, after);
}

}  // namespace touchstone::diagnosis::report
