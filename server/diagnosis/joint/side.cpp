#include "server/diagnosis/joint/side.h"

#include <absl/strings/str_cat.h>

#include <algorithm>

namespace touchstone::diagnosis::joint {
namespace {

// Lets the free values of effect `index` start where `instance` has them.
void StartAt(const model::EffectInstance& instance, int index, engine::Parameterization* model) {
  Eigen::VectorXd point = model->Start();
  for (int i = 0; i < model->size(); ++i) {
    const engine::FreeParameter& p = model->parameters()[i];
    if (p.effect != index) continue;
    const auto own = instance.object_values.find(p.object);
    const std::vector<double>& values = own == instance.object_values.end() ? instance.values : own->second;
    double sum = 0;
    for (size_t j = 0; j < values.size(); ++j) sum += p.weights[j] * values[j];
    point[i] = p.reciprocal ? 1 / sum : sum;
  }
  model->MoveTo(model->Clip(point));
}

void AddAt(const model::EffectInstance& instance, const std::string& object,
           engine::Parameterization* model) {
  if (object.empty())
    model->Add(instance.effect, instance.per_object);
  else
    model->AddOn(instance.effect, object);
  StartAt(instance, static_cast<int>(model->base().effects.size()) - 1, model);
}

void AddOwn(const OwnEffects& own, engine::Parameterization* model) {
  for (const auto& [name, instance] : own.freed) {
    const int index = IndexOf(model->base(), name);
    if (index < 0) continue;
    model->Free(index, true);
    StartAt(instance, index, model);
  }
  for (const auto& [instance, object] : own.added) AddAt(instance, object, model);
}

}  // namespace

std::string SharedEffect::Key() const {
  return absl::StrCat(name(), given ? " given" : "", instance.per_object ? " by object " : " ", object);
}

std::string OwnEffects::Key() const {
  std::string key;
  for (const auto& [name, instance] : freed) absl::StrAppend(&key, "given ", name, "\n");
  std::vector<std::string> names;
  for (const auto& [instance, object] : added)
    names.push_back(absl::StrCat(engine::NameOf(*instance.effect), instance.per_object ? " by object " : " ",
                                 object, "\n"));
  std::sort(names.begin(), names.end());
  for (const std::string& name : names) key += name;
  return key;
}

std::vector<std::string> OwnEffects::Names() const {
  std::vector<std::string> names;
  for (const auto& [name, instance] : freed) names.push_back(absl::StrCat(engine::kGivenPrefix, name));
  for (const auto& [instance, object] : added) names.push_back(engine::NameOf(*instance.effect));
  return names;
}

Side::Side(const engine::Modality& of, int place, std::function<bool(const model::Effect&)> shared)
    : kind(place),
      modality(&of),
      is_shared(std::move(shared)),
      settled(std::make_unique<engine::Experiment>(of.experiment())) {
  std::vector<engine::Candidate> own;
  for (const engine::Candidate& candidate : of.candidates()) {
    if (is_shared(*candidate.effect))
      settled->settled.push_back(candidate.effect->name);
    else
      own.push_back(candidate);
  }
  for (const model::EffectInstance& instance : given().effects)
    if (is_shared(*instance.effect)) settled->settled.push_back(instance.effect->name);
  const auto quiet = [](const std::string&) {};
  own_search =
      std::make_unique<engine::StepwiseSearch>(*settled, std::move(own), engine::SearchRules(), quiet);
  search = std::make_unique<engine::StepwiseSearch>(of.experiment(), of.candidates(), engine::SearchRules(),
                                                    quiet);
}

bool Side::HasObject(const std::string& object) const {
  return std::find(modality->objects().begin(), modality->objects().end(), object) !=
         modality->objects().end();
}

engine::Parameterization Side::Free(const std::vector<SharedEffect>& shared, const OwnEffects& own) const {
  engine::Parameterization model(given(), modality->objects());
  AddOwn(own, &model);
  for (const SharedEffect& effect : shared) {
    if (effect.given) {
      const int index = IndexOf(given(), effect.name());
      model.Free(index, true);
      StartAt(effect.instance, index, &model);
    } else if (effect.object.empty() || HasObject(effect.object)) {
      AddAt(effect.instance, effect.object, &model);
    }
  }
  return model;
}

engine::Parameterization Side::Held(const std::vector<SharedEffect>& shared, const OwnEffects& own) const {
  engine::Parameterization model(InPlace(given(), shared), modality->objects());
  AddOwn(own, &model);
  return model;
}

int Side::InitialEffects(const std::vector<SharedEffect>& shared) const {
  const auto added =
      std::count_if(shared.begin(), shared.end(), [](const SharedEffect& e) { return !e.given; });
  return static_cast<int>(given().effects.size() + added);
}

OwnEffects Side::OwnOf(const engine::Fit& fit, int initial_effects) const {
  OwnEffects own;
  const std::vector<model::EffectInstance>& effects = fit.model.base().effects;
  for (int index = 0; index < static_cast<int>(effects.size()); ++index) {
    if (is_shared(*effects[index].effect)) continue;
    if (index >= initial_effects)
      own.added.emplace_back(effects[index], fit.model.OnlyObject(index));
    else if (fit.model.IsFree(index))
      own.freed[engine::NameOf(*effects[index].effect)] = effects[index];
  }
  return own;
}

std::vector<SharedEffect> Side::SharedOf(const engine::Fit& fit) const {
  std::vector<SharedEffect> shared;
  const std::vector<model::EffectInstance>& effects = fit.model.base().effects;
  for (int index = 0; index < static_cast<int>(effects.size()); ++index) {
    if (!is_shared(*effects[index].effect) || !fit.model.IsFree(index)) continue;
    SharedEffect effect{effects[index], index < static_cast<int>(given().effects.size()),
                        fit.model.OnlyObject(index)};
    effect.rare =
        !effect.object.empty() || (effect.instance.per_object && !effect.instance.effect->often_per_object);
    shared.push_back(std::move(effect));
  }
  return shared;
}

SharedEffect WithValues(SharedEffect shared, const JointFit& fit) {
  for (auto own = fit.fits.rbegin(); own != fit.fits.rend();
       ++own) {  // where several have values, those of the first
    const model::Model& model = own->model.base();
    const int index = IndexOf(model, shared.name());
    if (index < 0) continue;
    const model::EffectInstance& found = model.effects[index];
    shared.instance.values = found.values;
    for (const auto& [object, values] : found.object_values) shared.instance.object_values[object] = values;
  }
  return shared;
}

int IndexOf(const model::Model& model, const std::string& name) {
  for (size_t index = 0; index < model.effects.size(); ++index)
    if (engine::NameOf(*model.effects[index].effect) == name) return static_cast<int>(index);
  return -1;
}

model::Model InPlace(const model::Model& given, const std::vector<SharedEffect>& shared) {
  model::Model model = given;
  for (const SharedEffect& effect : shared) {
    const int index = IndexOf(model, effect.name());
    if (effect.given && index >= 0)
      model.effects[index] = effect.instance;
    else
      model.effects.push_back(effect.instance);
  }
  return model;
}

}  // namespace touchstone::diagnosis::joint
