// SHA-256 of bytes that come in pieces.
#pragma once

#include <memory>
#include <string>

#include <absl/strings/string_view.h>

struct evp_md_ctx_st;

namespace touchstone {

class Sha256 {
 public:
  // std::bad_alloc where there is no memory: OpenSSL takes its own without new, and does not throw.
  Sha256();

  void Add(absl::string_view piece);
  // Of all pieces, 64 digits in lower case. Once: nothing may be added afterwards.
  std::string Hex();

 private:
  struct Free {
    void operator()(evp_md_ctx_st* context) const;
  };
  std::unique_ptr<evp_md_ctx_st, Free> context_;
};

}  // namespace touchstone
