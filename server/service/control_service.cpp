#include "server/service/control_service.h"

#include <absl/strings/str_cat.h>
#include <spdlog/spdlog.h>

#include "server/base/status.h"
#include "server/service/convert.h"

namespace touchstone {
grpc::Status ControlService::AcquireLease(grpc::ServerContext*, const v1::AcquireLeaseRequest* request,
                                          v1::Lease* response) {
  auto lease = leases_->Acquire(request->holder(), request->take());
  if (!lease.ok()) return ToGrpc(lease.status());
  *response = *std::move(lease);
  return grpc::Status::OK;
}

grpc::Status ControlService::RenewLease(grpc::ServerContext*, const v1::RenewLeaseRequest* request,
                                        v1::Lease* response) {
  auto lease = leases_->Renew(request->token());
  if (!lease.ok()) return ToGrpc(lease.status());
  *response = *std::move(lease);
  return grpc::Status::OK;
}

grpc::Status ControlService::ReleaseLease(grpc::ServerContext*, const v1::ReleaseLeaseRequest* request,
                                          v1::ReleaseLeaseResponse*) {
  return ToGrpc(leases_->Release(request->token()));
}

grpc::Status ControlService::Stop(grpc::ServerContext* context, const v1::StopRequest* request,
                                  v1::StopResponse* response) {
  const uint32_t running = resources_->running_requests;
  ++resources_->stop_count;
  spdlog::warn("stop from {}: {}; {} requests under way end", context->peer(),
               request->reason().empty() ? "no reason given" : request->reason(), running);
  response->set_aborted_touches(running);
  return grpc::Status::OK;
}

grpc::Status ControlService::GetState(grpc::ServerContext*, const v1::GetStateRequest*, v1::State* response) {
  const uint32_t requests = resources_->running_requests, streams = resources_->running_streams;
  response->set_state(resources_->draining ? "draining" : requests + streams > 0 ? "busy" : "idle");
  response->set_lease_holder(leases_->Holder());
  response->set_lease_epoch(leases_->epoch());
  response->set_running_requests(requests);
  response->set_running_streams(streams);
  response->set_touches(resources_->touches);
  response->set_images(resources_->images);
  response->set_uptime_s(
      std::chrono::duration<double>(std::chrono::steady_clock::now() - resources_->started).count());
  return grpc::Status::OK;
}

}  // namespace touchstone
