// touchstone.v1.Diagnosis: how wrong a model is, where, why, and what to add.
#pragma once

#include "server/service/core/resources.h"
#include "touchstone/v1/diagnosis.grpc.pb.h"

namespace touchstone::service {

class DiagnosisService final : public v1::Diagnosis::Service {
 public:
  explicit DiagnosisService(Resources* resources) : resources_(resources) {}

  grpc::Status Compare(grpc::ServerContext*, const v1::CompareRequest*,
                       grpc::ServerWriter<v1::CompareResponse>*) override;
  grpc::Status Diagnose(grpc::ServerContext*, const v1::DiagnoseRequest*,
                        grpc::ServerWriter<v1::DiagnoseResponse>*) override;
  grpc::Status Propose(grpc::ServerContext*, const v1::ProposeRequest*,
                       grpc::ServerWriter<v1::ProposeResponse>*) override;
  grpc::Status Check(grpc::ServerContext*, const v1::CheckRequest*,
                     grpc::ServerWriter<v1::CheckResponse>*) override;
  grpc::Status Explain(grpc::ServerContext*, const v1::ExplainRequest*,
                       grpc::ServerWriter<v1::ExplainResponse>*) override;
  grpc::Status Uncertainty(grpc::ServerContext*, const v1::UncertaintyRequest*,
                           grpc::ServerWriter<v1::UncertaintyResponse>*) override;

 private:
  Resources* resources_;
};

}  // namespace touchstone::service
