#include "server/service/rpc/control_service.h"

#include <absl/strings/str_cat.h>
#include <spdlog/spdlog.h>

#include "server/base/status.h"
#include "server/base/text/printable.h"
#include "server/service/connections/relayed_peer.h"
#include "server/service/core/convert.h"

namespace touchstone::service {
grpc::Status ControlService::AcquireLease(grpc::ServerContext* context,
                                          const v1::AcquireLeaseRequest* request, v1::Lease* response) {
  auto lease = leases_->Acquire(request->holder(), request->take(), resources_->access->CallerOf(*context));
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
  // A stop is never refused, so what is too long or no text is shortened or replaced.
  spdlog::warn(
      "stop from {} at {}: {}; {} requests under way end",
      WithCaller(request->holder().empty() ? "somebody" : Printable(request->holder(), kMaxHolderBytes),
                 resources_->access->CallerOf(*context)),
      PeerOf(*context),
      request->reason().empty() ? "no reason given" : Printable(request->reason(), kMaxReasonBytes), running);
  response->set_aborted_touches(running);
  response->set_standstill(true);
  return grpc::Status::OK;
}

absl::Status CheckReset(const v1::ResetRequest& request) {
  const auto fits = [](const std::string& text, size_t max_bytes) {
    return !text.empty() && text.size() <= max_bytes && IsPrintableLine(text);
  };
  if (!fits(request.holder(), kMaxHolderBytes))
    return absl::InvalidArgumentError(absl::StrCat("holder: say who releases the stop, in 1 to ",
                                                   kMaxHolderBytes,
                                                   " printable bytes, for instance 'ana@bench2'"));
  if (!fits(request.reason(), kMaxReasonBytes))
    return absl::InvalidArgumentError(absl::StrCat("reason: say why the source may move again, in 1 to ",
                                                   kMaxReasonBytes,
                                                   " printable bytes, for instance 'cable freed'"));
  return absl::OkStatus();
}

grpc::Status ControlService::Reset(grpc::ServerContext* context, const v1::ResetRequest* request,
                                   v1::State* response) {
  if (const absl::Status valid = CheckReset(*request); !valid.ok()) return ToGrpc(valid);
  return GetState(context, nullptr, response);
}

grpc::Status ControlService::GetState(grpc::ServerContext*, const v1::GetStateRequest*, v1::State* response) {
  const uint32_t requests = resources_->running_requests, streams = resources_->running_streams;
  response->set_state(resources_->draining     ? v1::SOURCE_STATE_DRAINING
                      : requests + streams > 0 ? v1::SOURCE_STATE_BUSY
                                               : v1::SOURCE_STATE_IDLE);
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

std::vector<CallQueue::Method> ControlService::StopMethods() {
  return {RawMethod(this, &ControlService::RequestStop, &resources_->options, &ControlService::Stop)};
}

std::vector<CallQueue::Method> ControlService::OtherMethods() {
  const Limits* const limits = &resources_->options;
  return {RawMethod(this, &ControlService::RequestAcquireLease, limits, &ControlService::AcquireLease),
          RawMethod(this, &ControlService::RequestRenewLease, limits, &ControlService::RenewLease),
          RawMethod(this, &ControlService::RequestReleaseLease, limits, &ControlService::ReleaseLease),
          RawMethod(this, &ControlService::RequestReset, limits, &ControlService::Reset),
          RawMethod(this, &ControlService::RequestGetState, limits, &ControlService::GetState)};
}

}  // namespace touchstone::service
