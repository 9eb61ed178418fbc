"""The benchmark's ends, programs of their own: plain nodes of either world that send, receive, serve or call."""
