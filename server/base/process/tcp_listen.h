// Opening a port of TCP with Boost.Asio.
#pragma once

#include <boost/asio/ip/tcp.hpp>

namespace touchstone {

// Listens at `at`; `port` is the one that was taken where that of `at` is 0. Returns what went wrong.
inline boost::system::error_code ListenAt(const boost::asio::ip::tcp::endpoint& at,
                                          boost::asio::ip::tcp::acceptor* acceptor, int* port) {
  boost::system::error_code error;
  acceptor->open(at.protocol(), error);
  if (!error) acceptor->set_option(boost::asio::socket_base::reuse_address(true), error);
  if (!error) acceptor->bind(at, error);
  if (!error) acceptor->listen(boost::asio::socket_base::max_listen_connections, error);
  if (!error) *port = acceptor->local_endpoint(error).port();
  return error;
}

}  // namespace touchstone
