"""Test tools: expectors, replayers, fakes and contracts. Students test their robots with them; time is virtual."""
