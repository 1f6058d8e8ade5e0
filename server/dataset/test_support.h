// Small datasets for tests.
#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <vector>

#include "server/dataset/stream.h"
#include "server/effects/all_effects.h"
#include "server/geometry/shapes/supershape.h"

namespace touchstone::dataset {

inline std::shared_ptr<const geometry::Surface> Supershape(const std::string& name,
                                                           uint64_t triangles = 2000) {
  auto mesh = geometry::MakeSupershape(*geometry::NamedSupershape(name), triangles);
  EXPECT_TRUE(mesh.ok()) << mesh.status();
  return *geometry::Surface::Create(name, *std::move(mesh));
}

inline std::shared_ptr<const model::Model> ModelOf(const std::string& effects) {
  std::string yaml = "touchstone: model/1\nname: test\nend_effector: {fingers: 3, spacing_mm: 30}\n";
  if (!effects.empty()) yaml += "effects:\n" + effects;
  auto model = model::ParseModel(yaml, "test", effects::Catalogue());
  EXPECT_TRUE(model.ok()) << model.status();
  return std::make_shared<const model::Model>(*std::move(model));
}

inline DatasetSpecification SmallDataset(
    uint64_t samples, const std::string& effects = "  - gaussian_noise: {sigma_us: 5000}\n") {
  DatasetSpecification specification;
  specification.objects = {Supershape("lat00"), Supershape("lat10"), Supershape("lat20")};
  specification.model = ModelOf(effects);
  specification.seed = 7;
  specification.samples = samples;
  specification.columns =
      *ColumnChoice::FromNames({"index", "object", "descriptor", "contact_time", "pose", "contact"});
  return specification;
}

// All bytes of a part, column after column, samples in order.
inline std::vector<std::string> Columns(const DatasetSpecification& specification, const DatasetPart& part,
                                        int threads, StreamShare share = {}) {
  ThreadPool pool(threads);
  auto shared = std::make_shared<DatasetSpecification>(specification);
  EXPECT_TRUE(ValidateDataset(shared.get()).ok());
  auto stream = DatasetStream::Create(shared, part, &pool, std::move(share));
  EXPECT_TRUE(stream.ok()) << stream.status();
  std::vector<std::string> columns(ColumnsOf(*shared).size());
  for (;;) {
    auto batch = (*stream)->Next({});
    EXPECT_TRUE(batch.ok()) << batch.status();
    if (!batch.ok() || !batch->has_value()) return columns;
    for (size_t k = 0; k < columns.size(); ++k) columns[k] += (*batch)->data[k];
  }
}

}  // namespace touchstone::dataset
